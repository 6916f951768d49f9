// Memory for the large arrays that are gathered from at random: 2 MiB pages spare most page faults and
// address look-ups.
#pragma once
#include <sys/mman.h>

#include <cstdlib>
#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace gonio {

// Elements of a vector with this allocator start uninitialised: such arrays are always written whole before
// they are read.
template <class T>
struct HugePageAllocator {
    using value_type = T;
    static constexpr size_t page = size_t{2} << 20;

    HugePageAllocator() = default;
    template <class U>
    HugePageAllocator(const HugePageAllocator<U>&) {}

    T* allocate(size_t n) {
        const size_t bytes = n * sizeof(T), alignment = bytes >= page ? page : 64;
        void* memory = std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
        if (!memory) throw std::bad_alloc();
        if (bytes >= page)
            madvise(memory, bytes, MADV_HUGEPAGE);  // a wish: without it everything works, slower
        return static_cast<T*>(memory);
    }
    void deallocate(T* memory, size_t) { std::free(memory); }
    template <class U>
    void construct(U* at) {
        ::new (static_cast<void*>(at)) U;
    }
    template <class U, class... Args>
    void construct(U* at, Args&&... args) {
        ::new (static_cast<void*>(at)) U(std::forward<Args>(args)...);
    }
    bool operator==(const HugePageAllocator&) const { return true; }
};

using HugeFloats = std::vector<float, HugePageAllocator<float>>;

}  // namespace gonio
