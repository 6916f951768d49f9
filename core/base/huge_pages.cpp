#include "base/huge_pages.h"

#include <malloc.h>
#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <mutex>

namespace gonio {
namespace {

// Blocks that wait for their next use.
class KeptBlocks {
  public:
    KeptBlocks() { blocks_.reserve(most_kept_memory / huge_page + 1); }  // so that nothing throws later

    // The smallest that is large enough, but not by more than an eighth; null if there is none.
    void* take(size_t size) {
        const std::lock_guard lock(mutex_);
        auto best = blocks_.end();
        for (auto b = blocks_.begin(); b != blocks_.end(); ++b)
            if (b->size >= size && b->size <= size + size / 8 + huge_page &&
                (best == blocks_.end() || b->size < best->size))
                best = b;
        if (best == blocks_.end()) return nullptr;
        void* memory = best->memory;
        kept_ -= best->size;
        blocks_.erase(best);
        return memory;
    }
    // Those that have waited longest make room.
    void keep(void* memory) {
        const std::lock_guard lock(mutex_);
        blocks_.push_back({memory, malloc_usable_size(memory)});
        for (kept_ += blocks_.back().size; kept_ > most_kept_memory; blocks_.erase(blocks_.begin())) {
            std::free(blocks_.front().memory);
            kept_ -= blocks_.front().size;
        }
    }

    size_t bytes() const {
        const std::lock_guard lock(mutex_);
        return kept_;
    }

  private:
    struct Block {
        void* memory;
        size_t size;
    };
    mutable std::mutex mutex_;
    std::vector<Block> blocks_;  // oldest first
    size_t kept_ = 0;
};

KeptBlocks& kept_blocks() {
    static KeptBlocks& blocks = *new KeptBlocks;  // outlives every array
    return blocks;
}

}  // namespace

void* take_huge_pages(size_t bytes) {
    const size_t alignment = bytes >= huge_page ? huge_page : 64,
                 size = (bytes + alignment - 1) / alignment * alignment;
    if (bytes >= huge_page)
        if (void* kept = kept_blocks().take(size)) return kept;
    void* memory = std::aligned_alloc(alignment, size);
    if (!memory) throw std::bad_alloc();
    if (bytes >= huge_page)
        madvise(memory, size, MADV_HUGEPAGE);  // a wish: without it everything works, slower
    return memory;
}

void give_back_huge_pages(void* memory, size_t bytes) noexcept {
    if (bytes >= huge_page)
        kept_blocks().keep(memory);
    else
        std::free(memory);
}

size_t kept_memory() {
    return kept_blocks().bytes();
}

}  // namespace gonio
