// The numbers of a material as the document writes them: constants, colours, spectra and maps. Internal to
// server/.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "material/lobe_parameters.h"
#include "server/job.h"
#include "server/json_node.h"

namespace gonio {

// All numbers of a material have the same channels; who is first to have several names them.
class ParameterParser {
  public:
    explicit ParameterParser(std::string folder) : folder_(std::move(folder)) {}

    // The value, or any that is allowed in place of a map, whose files are in files() under the path of the
    // node.
    Parameter parse(const JsonNode& node, const ParameterRange& range);

    // Wavelengths as channels: {"wavelengths_nm": [...]}, 311 to 837 nm where a metal asks for them.
    void claim_wavelengths(const JsonNode& wavelengths_nm);
    void claim_rgb(const JsonNode& node) { claim({"r", "g", "b"}, {}, node); }

    // Empty as long as nobody had several.
    const std::vector<std::string>& channels() const { return channels_; }
    const std::vector<double>& wavelengths_nm() const { return wavelengths_nm_; }

    struct Files {
        std::string field;  // the JSON pointer
        std::vector<std::string> paths;
    };
    const std::vector<Files>& files() const { return files_; }

  private:
    void claim(std::vector<std::string> channels, std::vector<double> wavelengths_nm, const JsonNode& node);
    Parameter add_files(const JsonNode& node, const JsonNode& files, const ParameterRange& range);
    Parameter parse_spectrum(const JsonNode& node, const ParameterRange& range);

    std::string folder_;
    std::vector<std::string> channels_;
    std::vector<double> wavelengths_nm_;
    std::vector<Files> files_;
};

}  // namespace gonio
