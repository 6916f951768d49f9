#include "base/huge_pages.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>

namespace gonio {
namespace {

constexpr size_t mib = size_t{1} << 20;

TEST(HugePages, AnArrayOfTheSameSizeGetsTheMemoryOfTheLastOne) {
    void* const first = take_huge_pages(10 * mib);
    EXPECT_EQ(reinterpret_cast<uintptr_t>(first) % huge_page, 0);
    give_back_huge_pages(first, 10 * mib);
    const size_t kept = kept_memory();
    EXPECT_GE(kept, 10 * mib);
    void* const again = take_huge_pages(9 * mib + 5);
    EXPECT_EQ(again, first);
    EXPECT_LE(kept_memory(), kept - 10 * mib);
    void* const other = take_huge_pages(9 * mib);
    EXPECT_NE(other, first);
    give_back_huge_pages(again, 9 * mib + 5);
    void* const small = take_huge_pages(3 * mib);
    EXPECT_NE(small, first);  // 10 MiB would be wasted on it
    for (const auto& [memory, bytes] : {std::pair{other, 9 * mib}, {small, 3 * mib}})
        give_back_huge_pages(memory, bytes);
    void* const large = take_huge_pages(50 * mib);  // none that waits has room for it
    for (void* const waiting : {first, other, small}) EXPECT_NE(large, waiting);
    give_back_huge_pages(large, 50 * mib);
}

TEST(HugePages, NoMoreWaitsThanTheLimit) {
    std::vector<void*> blocks;
    for (int k = 0; k < 5; ++k) blocks.push_back(take_huge_pages(100 * mib));
    for (void* block : blocks) give_back_huge_pages(block, 100 * mib);
    EXPECT_LE(kept_memory(), most_kept_memory);
    EXPECT_GE(kept_memory(), 200 * mib);
    give_back_huge_pages(take_huge_pages(2 * most_kept_memory), 2 * most_kept_memory);
    EXPECT_LE(kept_memory(), most_kept_memory);
    give_back_huge_pages(take_huge_pages(100), 100);
}

TEST(HugePages, ThreadsGetMemoryOfTheirOwn) {
    std::vector<std::thread> threads;
    std::vector<int> wrong(4, 0);
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&wrong, t] {
            for (int k = 0; k < 200; ++k) {
                HugeFloats values(700000 + 1000 * k);
                std::fill(values.begin(), values.end(), static_cast<float>(t));
                for (const float v : values) wrong[t] += v != static_cast<float>(t);
            }
        });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(wrong, std::vector<int>(4, 0));
}

}  // namespace
}  // namespace gonio
