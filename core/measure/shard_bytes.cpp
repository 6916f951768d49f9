#include "measure/shard_bytes.h"

#include <cstring>
#include <type_traits>

#include "base/error.h"

namespace gonio {
namespace {

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

// T to read into, const T to write from: one list of members each, below.
template <class X, class T>
concept Either = std::is_same_v<std::remove_const_t<X>, T>;

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

template <class Archive, Either<RunValues> Run>
void visit(Archive& archive, Run& run) {
    archive(run.higher_orders);
    archive(run.applications);
    archive(run.ratio);
    archive(run.remainder);
    archive(run.turn);
    archive(run.heaviest);
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

template <class Archive, Either<NoiseBias> Bias>
void visit(Archive& archive, Bias& bias) {
    archive(bias.kappa);
    archive(bias.doubt);
    visit_matrix(archive, bias.pairs);
    archive(bias.core_area);
}

template <class Archive, Either<MeshBias> Bias>
void visit(Archive& archive, Bias& bias) {
    uint64_t orders = bias.exact.size();
    archive(orders);
    if constexpr (!std::is_const_v<Bias>) {
        bias.exact.resize(orders);
        bias.coarse.resize(orders);
    }
    for (auto& m : bias.exact) visit_matrix(archive, m);
    for (auto& m : bias.coarse) visit_matrix(archive, m);
    archive(bias.asked);
    int all_pairs = bias.all_pairs;
    archive(all_pairs);
    if constexpr (!std::is_const_v<Bias>) bias.all_pairs = all_pairs != 0;
    archive(bias.guess);
    archive(bias.guess_caution);
    archive(bias.ratio);
}

template <class Archive, Either<PathTally> Tally>
void visit(Archive& archive, Tally& tally) {
    archive(tally.sum);
    archive(tally.squared_spread);
    archive(tally.rays.camera);
    archive(tally.rays.bounce);
    archive(tally.rays.shadow);
    archive(tally.rays.spared);
    archive(tally.rays.lost);
}

template <class Archive, Either<double> Number>
void visit(Archive& archive, Number& number) {
    archive(number);
}

template <class T>
std::string encoded(const T& value) {
    Writer writer;
    visit(writer, value);
    return writer.take();
}

template <class T>
T decoded(const std::string& bytes) {
    T value;
    Reader reader(bytes);
    visit(reader, value);
    reader.expect_end();
    return value;
}

}  // namespace

std::string to_bytes(const RunValues& values) {
    return encoded(values);
}
std::string to_bytes(const NoiseBias& bias) {
    return encoded(bias);
}
std::string to_bytes(const MeshBias& bias) {
    return encoded(bias);
}
std::string to_bytes(const PathTally& tally) {
    return encoded(tally);
}
std::string to_bytes(double number) {
    return encoded(number);
}

RunValues run_values_from(const std::string& bytes) {
    return decoded<RunValues>(bytes);
}
NoiseBias noise_bias_from(const std::string& bytes) {
    return decoded<NoiseBias>(bytes);
}
MeshBias mesh_bias_from(const std::string& bytes) {
    return decoded<MeshBias>(bytes);
}
PathTally path_tally_from(const std::string& bytes) {
    return decoded<PathTally>(bytes);
}

double number_from(const std::string& bytes) {
    return decoded<double>(bytes);
}

}  // namespace gonio
