// A small job and a folder for it, for the tests of executors.
#pragma once
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "server/executor/job_folder.h"

namespace gonio {

inline const std::string small_job = R"({
    "surface": {"generate": "gaussian", "samples": 16, "pitch": "10 um", "correlation_length": "40 um", "rms_slope": 0.5},
    "material": {"model": "lambertian", "albedo": 0.5},
    "measure": {"kind": "brdf", "incident": {"hemisphere": 2}, "outgoing": {"hemisphere": 3}},
    "accuracy": {"samples": {"replicates": 4, "directions": 16}}})";

class ExecutorTest : public testing::Test {
  protected:
    ExecutorTest() {
        std::string name = (std::filesystem::temp_directory_path() / "gonio executor's-XXXXXX").string();
        if (!::mkdtemp(name.data())) throw std::runtime_error("no temporary folder");
        root = name;
    }
    ~ExecutorTest() override { std::filesystem::remove_all(root); }

    // A shell script in root/bin.
    std::string script(const std::string& name, const std::string& text) const {
        std::filesystem::create_directories(root / "bin");
        const std::filesystem::path path = root / "bin" / name;
        std::ofstream(path) << "#!/bin/sh\n" << text << "\n";
        std::filesystem::permissions(path, std::filesystem::perms(0755));
        return path.string();
    }
    std::string read(const std::filesystem::path& path) const {
        std::ifstream in(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    JobFolder folder(const std::string& program = "gonio") const {
        return {root / "shared", loaded, small_job, ".", {program, 1}, {}};
    }

    std::filesystem::path root;
    LoadedJob loaded = load_job(parse_job(small_job, {}));
};

}  // namespace gonio
