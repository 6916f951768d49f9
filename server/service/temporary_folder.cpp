#include "server/service/temporary_folder.h"

#include <cstdlib>

#include "base/error.h"

namespace gonio {

TemporaryFolder::TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "gonio-XXXXXX").string();
    if (!::mkdtemp(name.data())) throw Error(ErrorCode::io, name, "", "cannot be made");
    path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
}

}  // namespace gonio
