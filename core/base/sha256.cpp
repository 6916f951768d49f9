#include "base/sha256.h"

#include <openssl/evp.h>

#include <array>

#include "base/error.h"

namespace gonio {
namespace {

EVP_MD_CTX* typed(void* context) {
    return static_cast<EVP_MD_CTX*>(context);
}

void require(bool good) {
    if (!good) throw Error(ErrorCode::internal, "", "", "the SHA-256 of the OpenSSL library failed");
}

}  // namespace

void Sha256::FreeContext::operator()(void* context) const {
    EVP_MD_CTX_free(typed(context));
}

Sha256::Sha256() : context_(EVP_MD_CTX_new()) {
    require(context_ && EVP_DigestInit_ex(typed(context_.get()), EVP_sha256(), nullptr) == 1);
}

void Sha256::update(std::string_view bytes) {
    require(EVP_DigestUpdate(typed(context_.get()), bytes.data(), bytes.size()) == 1);
}

std::string Sha256::hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
    unsigned int length = 0;
    require(EVP_DigestFinal_ex(typed(context_.get()), digest.data(), &length) == 1);
    std::string text;
    for (unsigned int k = 0; k < length; ++k) {
        text += "0123456789abcdef"[digest[k] >> 4];
        text += "0123456789abcdef"[digest[k] & 15];
    }
    return text;
}

std::string sha256_hex(std::initializer_list<std::string_view> pieces) {
    Sha256 sum;
    for (const std::string_view piece : pieces) sum.update(piece);
    return sum.hex();
}

}  // namespace gonio
