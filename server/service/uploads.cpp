#include "server/service/uploads.h"

#include "server/json_node.h"
#include "server/service/untrusted.h"

namespace gonio {
namespace {

using nlohmann::json;

class Resolver {
  public:
    Resolver(UploadedFiles& files, const Objects& objects) : files_(files), objects_(objects) {}

    // Of the object at `node`, to which `value` is open for change.
    void resolve(const JsonNode& node, json& value) const {
        for (const char* key : {"file", "files"})
            if (const auto file = node.find(key))
                file->refuse(R"(files of the server are not read: upload it and give its "sha256")");
        const auto named = node.find("sha256");
        if (!named) return;
        value.erase("sha256");
        if (!named->raw().is_array()) {
            value["file"] = path_of(*named);
            return;
        }
        json& list = value["files"] = json::array();
        for (size_t k = 0; k < named->array_size(); ++k) list.push_back(path_of(named->element(k)));
    }

    // Of every object inside: any number of a material may be a map.
    void resolve_all(const JsonNode& node, json& value) const {
        if (node.raw().is_object()) {
            for (const auto& [key, unused] : node.raw().items()) resolve_all(node.at(key), value[key]);
            resolve(node, value);
        } else if (node.raw().is_array()) {
            // Numbers name nothing: of a long list of them not one path is made.
            for (size_t k = 0; k < node.raw().size(); ++k)
                if (node.raw()[k].is_structured()) resolve_all(node.element(k), value[k]);
        }
    }

  private:
    std::string path_of(const JsonNode& named) const {
        const std::string sha256 = named.text();
        if (!objects_.exists(sha256)) named.refuse("was not uploaded (PUT /surfaces/{sha256})");
        files_.surfaces.push_back(sha256);
        return objects_.path(sha256);
    }

    UploadedFiles& files_;
    const Objects& objects_;
};

}  // namespace

UploadedFiles resolve_uploads(const json& document, const Objects& objects) {
    UploadedFiles files{document, {}};
    const Resolver resolver(files, objects);
    const JsonNode root(document);
    if (const auto surface = root.find("surface"); surface && surface->raw().is_object())
        resolver.resolve(*surface, files.document["surface"]);
    if (const auto environment = root.find("environment"); environment && environment->raw().is_object())
        resolver.resolve(*environment, files.document["environment"]);
    if (const auto material = root.find("material"))
        resolver.resolve_all(*material, files.document["material"]);
    return files;
}

void read_as_untrusted(SurfaceSource& surface) {
    if (auto* file = std::get_if<FileSurface>(&surface)) file->read = read_untrusted_heights;
}

void read_as_untrusted(Job& job) {
    read_as_untrusted(job.surface);
    job.material.read = read_untrusted_heights;
    if (job.environment) job.environment->read = read_untrusted_radiance;
}

}  // namespace gonio
