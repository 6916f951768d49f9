// Memory for the large arrays that are gathered from at random: 2 MiB pages spare most page faults and
// address look-ups.
#pragma once
#include <cstddef>
#include <new>
#include <utility>
#include <vector>

namespace gonio {

inline constexpr size_t huge_page = size_t{2} << 20, most_kept_memory = size_t{256} << 20;

// Memory that is given back is kept, up to most_kept_memory bytes of it, for the next array of about its
// size: every run takes the same ones, and for the kernel to clear fresh pages took a tenth of a run.
// Throws std::bad_alloc. bytes: what was asked for.
void* take_huge_pages(size_t bytes);
void give_back_huge_pages(void* memory, size_t bytes) noexcept;
size_t kept_memory();  // bytes that wait

// Elements of a vector with this allocator start uninitialised: such arrays are always written whole before
// they are read.
template <class T>
struct HugePageAllocator {
    using value_type = T;

    HugePageAllocator() = default;
    template <class U>
    HugePageAllocator(const HugePageAllocator<U>&) {}

    T* allocate(size_t n) { return static_cast<T*>(take_huge_pages(n * sizeof(T))); }
    void deallocate(T* memory, size_t n) noexcept { give_back_huge_pages(memory, n * sizeof(T)); }
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
