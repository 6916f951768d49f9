#include "base/sha256.h"

#include <openssl/evp.h>

#include <array>
#include <memory>

#include "base/error.h"

namespace gonio {

std::string sha256_hex(std::initializer_list<std::string_view> pieces) {
    const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context(EVP_MD_CTX_new(), EVP_MD_CTX_free);
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
    unsigned int length = 0;
    bool good = context && EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr) == 1;
    for (const std::string_view piece : pieces)
        good = good && EVP_DigestUpdate(context.get(), piece.data(), piece.size()) == 1;
    if (!good || EVP_DigestFinal_ex(context.get(), digest.data(), &length) != 1)
        throw Error(ErrorCode::internal, "", "", "the SHA-256 of the OpenSSL library failed");

    std::string hex;
    for (unsigned int k = 0; k < length; ++k) {
        hex += "0123456789abcdef"[digest[k] >> 4];
        hex += "0123456789abcdef"[digest[k] & 15];
    }
    return hex;
}

}  // namespace gonio
