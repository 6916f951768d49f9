#include "base/sha256.h"
#include "server/load_job.h"

namespace gonio {

Environment load_environment(const EnvironmentSource& source) {
    if (!source.radiance.empty()) return uniform_environment(source.radiance);
    return make_environment(source.read(source.path), source.layout, radians(source.rotation_deg),
                            source.scale);
}

std::string environment_hash(const Environment& environment) {
    const int sizes[] = {environment.nx, environment.ny, environment.n_channels};
    return sha256_hex({bytes_of(sizes, 3), bytes_of(&environment.rotation, 1),
                       bytes_of(environment.radiance.data(), environment.radiance.size())});
}

}  // namespace gonio
