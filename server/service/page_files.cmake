# Writes page_files.h: every file of the page as an array of bytes.
# cmake -DFOLDER=clients/page -DFILES="index.html;main.js" -DOUTPUT=page_files.h -P page_files.cmake
set(arrays "")
set(entries "")
foreach(name IN LISTS FILES)
    string(MAKE_C_IDENTIFIER ${name} identifier)
    file(READ ${FOLDER}/${name} bytes HEX)
    string(REGEX REPLACE "(..)" "'\\\\x\\1'," bytes "${bytes}")
    string(APPEND arrays "inline constexpr char ${identifier}[] = {${bytes}};\n")
    string(APPEND entries "    {\"${name}\", {${identifier}, sizeof ${identifier}}},\n")
endforeach()
file(WRITE ${OUTPUT} "// Written by page_files.cmake.
#pragma once
#include <string_view>

namespace gonio {

struct PageFile {
    std::string_view name, content;
};
${arrays}
inline constexpr PageFile page_files[] = {
${entries}};

}  // namespace gonio
")
