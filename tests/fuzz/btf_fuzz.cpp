// Feeds bytes to the reader of factored BTFs and, where they are one, to what expands it. Whatever the bytes,
// only Error may come out, and no pixel may show a facet that is not there.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "base/error.h"
#include "measure/btf_views.h"
#include "server/btf_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace gonio;
    static const int file = memfd_create("btf", 0);
    static const std::string path = "/proc/self/fd/" + std::to_string(file);
    if (ftruncate(file, 0) != 0 || pwrite(file, data, size, 0) != static_cast<ssize_t>(size)) return 0;
    try {
        const Btf btf = read_factored_btf(path).btf;
        if (btf.shape.images_size() > (1 << 20)) return 0;
        std::vector<uint16_t> images(btf.shape.images_size() / btf.shape.n_views);
        for (int view = 0; view < btf.shape.n_views; ++view)
            expand_view(btf.shape, btf.radiance, btf.view_maps, view, images);
    } catch (const Error& error) {
        if (std::string(error.what()).empty()) __builtin_trap();
    }
    return 0;
}
