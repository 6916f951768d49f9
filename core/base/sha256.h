// SHA-256, the name of a job and of a surface in provenance.
#pragma once
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>

namespace gonio {

// Of bytes that come bit by bit.
class Sha256 {
  public:
    Sha256();
    void update(std::string_view bytes);
    std::string hex();  // 64 lower-case hex digits; once, at the end

  private:
    struct FreeContext {
        void operator()(void* context) const;
    };
    std::unique_ptr<void, FreeContext> context_;
};

// Of the pieces one after the other (no separators: fixed-size pieces first), as 64 lower-case hex digits.
std::string sha256_hex(std::initializer_list<std::string_view> pieces);

inline std::string sha256_hex(std::string_view bytes) {
    return sha256_hex({bytes});
}

// The bytes of an object or array, for hashing.
template <class T>
std::string_view bytes_of(const T* data, size_t count) {
    return {reinterpret_cast<const char*>(data), count * sizeof(T)};
}

}  // namespace gonio
