#include "measure/shard_bytes.h"

#include <cstring>
#include <type_traits>

#include "base/error.h"

namespace gonio {
namespace {

// One list of members serves writing and reading: visit(archive, values) below.
class Writer {
  public:
    template <class T>
    requires std::is_arithmetic_v<T>
    void operator()(const T& value) { bytes_.append(reinterpret_cast<const char*>(&value), sizeof value); }
    template <class Numbers>
    requires std::is_arithmetic_v<typename Numbers::value_type>
    void operator()(const Numbers& numbers) {
        (*this)(static_cast<uint64_t>(numbers.size()));
        bytes_.append(reinterpret_cast<const char*>(numbers.data()),
                      numbers.size() * sizeof(typename Numbers::value_type));
    }
    std::string take() { return std::move(bytes_); }

  private:
    std::string bytes_;
};

class Reader {
  public:
    explicit Reader(const std::string& bytes) : bytes_(bytes) {}
    template <class T>
    requires std::is_arithmetic_v<T>
    void operator()(T& value) { std::memcpy(&value, next(sizeof value), sizeof value); }
    template <class Numbers>
    requires std::is_arithmetic_v<typename Numbers::value_type>
    void operator()(Numbers& numbers) {
        uint64_t n = 0;
        (*this)(n);
        if (n > bytes_.size()) fail();
        const size_t size = n * sizeof(typename Numbers::value_type);
        const char* from = next(size);
        numbers.resize(n);
        if (size > 0) std::memcpy(numbers.data(), from, size);
    }
    void expect_end() const {
        if (at_ != bytes_.size()) fail();
    }

  private:
    const char* next(size_t n) {
        if (n > bytes_.size() - at_) fail();
        at_ += n;
        return bytes_.data() + at_ - n;
    }
    [[noreturn]] static void fail() {
        throw Error(ErrorCode::io, "checkpoint", "", "is not what this version of gonio writes");
    }
    const std::string& bytes_;
    size_t at_ = 0;
};

template <class Archive, class M>
void visit_matrix(Archive& archive, M& m) {
    archive(m.rows);
    archive(m.columns);
    archive(m.values);
}

void visit_fields(Writer& archive, const Fields& fields) {
    archive(static_cast<uint64_t>(fields.n_unknowns()));
    archive(fields.n_columns());
    archive(fields.values());
}
void visit_fields(Reader& archive, Fields& fields) {
    uint64_t unknowns = 0;
    int columns = 0;
    archive(unknowns);
    archive(columns);
    HugeFloats values;
    archive(values);
    fields = Fields(unknowns, columns, std::move(values));
}

template <class Archive, class Run>
void visit_run(Archive& archive, Run& run) {
    archive(run.higher_orders);
    archive(run.applications);
    archive(run.ratio);
    archive(run.remainder);
    archive(run.f);
    archive(run.direct);
    archive(run.projected_lights);
    archive(run.projected_views);
    visit_fields(archive, run.first_irradiance);
    visit_fields(archive, run.first);
    archive(run.rays);
    archive(run.rays_skipped);
    archive(run.links);
    archive(run.substituted);
    archive(run.dropped);
    archive(run.truncated_bundles);
    archive(run.seconds_direct);
    archive(run.seconds_links);
    archive(run.seconds_series);
}

template <class Archive, class Bias>
void visit_noise(Archive& archive, Bias& bias) {
    archive(bias.kappa);
    archive(bias.doubt);
    visit_matrix(archive, bias.pairs);
    archive(bias.core_area);
}

template <class Archive, class Bias>
void visit_mesh(Archive& archive, Bias& bias) {
    uint64_t orders = bias.exact.size();
    archive(orders);
    bias.exact.resize(orders);
    bias.coarse.resize(orders);
    for (auto& m : bias.exact) visit_matrix(archive, m);
    for (auto& m : bias.coarse) visit_matrix(archive, m);
    archive(bias.asked);
    int all_pairs = bias.all_pairs;
    archive(all_pairs);
    bias.all_pairs = all_pairs != 0;
    archive(bias.guess);
    archive(bias.guess_caution);
    archive(bias.ratio);
}

template <class Archive, class Tally>
void visit_tally(Archive& archive, Tally& tally) {
    archive(tally.sum);
    archive(tally.squared_spread);
    archive(tally.rays.camera);
    archive(tally.rays.bounce);
    archive(tally.rays.shadow);
    archive(tally.rays.spared);
    archive(tally.rays.lost);
}

}  // namespace

std::string to_bytes(const RunValues& values) {
    Writer writer;
    visit_run(writer, values);
    return writer.take();
}

std::string to_bytes(const PathTally& tally) {
    Writer writer;
    visit_tally(writer, tally);
    return writer.take();
}

std::string to_bytes(const NoiseBias& bias) {
    Writer writer;
    visit_noise(writer, bias);
    return writer.take();
}

std::string to_bytes(const MeshBias& bias) {
    Writer writer;
    MeshBias copy = bias;  // visit_mesh sizes its lists, which are those of the copy already
    visit_mesh(writer, copy);
    return writer.take();
}

RunValues run_values_from(const std::string& bytes) {
    RunValues values;
    Reader reader(bytes);
    visit_run(reader, values);
    reader.expect_end();
    return values;
}

NoiseBias noise_bias_from(const std::string& bytes) {
    NoiseBias bias;
    Reader reader(bytes);
    visit_noise(reader, bias);
    reader.expect_end();
    return bias;
}

MeshBias mesh_bias_from(const std::string& bytes) {
    MeshBias bias;
    Reader reader(bytes);
    visit_mesh(reader, bias);
    reader.expect_end();
    return bias;
}

PathTally path_tally_from(const std::string& bytes) {
    PathTally tally;
    Reader reader(bytes);
    visit_tally(reader, tally);
    reader.expect_end();
    return tally;
}

}  // namespace gonio
