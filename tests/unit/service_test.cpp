// The service between HTTP and the store: what it describes, what it predicts, what it lets near a file.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "measure/prediction.h"
#include "server/job.h"
#include "server/load_job.h"
#include "server/service/hillshade.h"
#include "server/service/openapi.h"
#include "server/service/processes.h"
#include "server/service/responses.h"
#include "server/service/untrusted.h"
#include "server/service/uploads.h"
#include "surface/generate.h"

namespace gonio {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

TEST(Times, ReadWhatTheyWrite) {
    for (const int64_t ms : {int64_t{0}, int64_t{951782400123}, int64_t{1795261563007}})
        EXPECT_EQ(time_from(time_text(ms)), ms);
    EXPECT_EQ(time_from("2026-01-31T12:00:00Z"), 1769860800000);
    for (const char* bad :
         {"", "2026-01-31", "2026-01-31T12:00:00", "2026-01-31T12:00:00+01:00", "2026-01-31T12:00:00.Z"})
        EXPECT_FALSE(time_from(bad)) << bad;
}

TEST(Processes, DescribeEveryInputAndOutput) {
    EXPECT_GE(service_processes().size(), 3u);
    for (const ServiceProcess& process : service_processes()) {
        const auto description = process_description(process);
        for (const std::string& name : process.inputs)
            EXPECT_TRUE(description.at("inputs").at(name).at("schema").is_object())
                << process.id << " " << name;
        EXPECT_EQ(description.at("outputs").size(), process.outputs.size());
        EXPECT_EQ(find_process(process.id), &process);
    }
    EXPECT_EQ(find_process("nothing"), nullptr);
}

TEST(Processes, OpenApiIsTheFile) {
    const json document = json::parse(openapi_document());
    EXPECT_EQ(document.at("openapi"), "3.0.3");
}

class Uploads : public testing::Test {
  protected:
    Uploads()
        : folder_(fs::temp_directory_path() / ("gonio_uploads_" + std::to_string(::getpid()))),
          objects_(made(folder_)) {}
    static std::string made(const std::string& folder) {
        fs::create_directories(folder);
        return folder;
    }
    ~Uploads() override { fs::remove_all(folder_); }
    std::string refusal(const json& document) {
        try {
            resolve_uploads(document, objects_);
        } catch (const Error& error) {
            return error.field();
        }
        return "accepted";
    }
    std::string folder_;
    Objects objects_;
};

TEST_F(Uploads, AreNamedByHashAndNothingElse) {
    const std::string sha256 = objects_.put("1 2\n3 4\n").sha256;
    const UploadedFiles files = resolve_uploads(
        {{"surface", {{"sha256", sha256}, {"pitch", "1 um"}}},
         {"material", {{"model", "lambertian"}, {"albedo", {{"sha256", {sha256, sha256, sha256}}}}}}},
        objects_);
    EXPECT_EQ(files.surfaces, std::vector<std::string>(4, sha256));
    EXPECT_EQ(files.document["surface"]["file"], objects_.path(sha256));
    EXPECT_FALSE(files.document["surface"].contains("sha256"));
    EXPECT_EQ(files.document["material"]["albedo"]["files"].size(), 3u);

    EXPECT_EQ(refusal({{"surface", {{"file", "/etc/passwd"}}}}), "/surface/file");
    EXPECT_EQ(refusal({{"surface", {{"sha256", std::string(64, '0')}}}}), "/surface/sha256");
    EXPECT_EQ(refusal({{"surface", {{"sha256", "../../etc/passwd"}}}}), "/surface/sha256");
    EXPECT_EQ(refusal({{"material", {{"albedo", {{"files", {"/etc/passwd"}}}}}}}), "/material/albedo/files");
    EXPECT_EQ(refusal({{"material", {{"albedo", {{"sha256", {sha256, std::string(64, '0')}}}}}}}),
              "/material/albedo/sha256/1");
    // Wherever a material may name a file.
    const nlohmann::json parts = {{{"weight", {{"sha256", sha256}}}, {"alpha", {{"sha256", sha256}}}}};
    const nlohmann::json mixture =
        resolve_uploads({{"material", {{"model", "mixture"}, {"parts", parts}}}}, objects_).document;
    EXPECT_EQ(mixture["material"]["parts"][0]["weight"]["file"], objects_.path(sha256));
    EXPECT_EQ(mixture["material"]["parts"][0]["alpha"]["file"], objects_.path(sha256));
    const nlohmann::json stranger = {{{"weight", 1}, {"exponent", {{"file", "/etc/passwd"}}}}};
    EXPECT_EQ(refusal({{"material", {{"model", "mixture"}, {"parts", stranger}}}}),
              "/material/parts/0/exponent/file");
}

// What the decoder of a stranger's file is left with.
TEST(Untrusted, ChildCanNeitherOpenNorSendNorStart) {
    const auto killed = testing::KilledBySignal(SIGSYS);
    EXPECT_EXIT((give_up_system_calls(), ::open("/dev/null", O_RDONLY), ::_exit(0)), killed, "");
    EXPECT_EXIT((give_up_system_calls(), ::socket(AF_INET, SOCK_STREAM, 0), ::_exit(0)), killed, "");
    EXPECT_EXIT((give_up_system_calls(), ::fork(), ::_exit(0)), killed, "");
    EXPECT_EXIT(
        (give_up_system_calls(),
         ::mmap(nullptr, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0), ::_exit(0)),
        killed, "");
    // That it can still compute is seen where OpenEXR files are uploaded (tests/end_to_end).
}

TEST(Hillshade, IsBrightTowardsTheLight) {
    // A ridge along y: its left flank faces the light in the upper left.
    std::vector<double> heights(16 * 4);
    for (size_t k = 0; k < heights.size(); ++k)
        heights[k] = 1e-6 * static_cast<double>(k % 16 < 8 ? k % 16 : 16 - k % 16);
    const std::string png = hillshade_png(make_height_field(16, 4, 1e-6, 1e-6, heights));
    const fs::path path = fs::temp_directory_path() / ("gonio_shade_" + std::to_string(::getpid()) + ".png");
    std::ofstream(path, std::ios::binary) << png;
    const RawHeights grey = read_heights(path.string());
    fs::remove(path);
    ASSERT_EQ(grey.nx, 16);
    ASSERT_EQ(grey.ny, 4);
    EXPECT_GT(grey.values[3], grey.values[12] + 50);
}

// Twelve times the table is twelve times its bytes, and whatever makes a job longer is predicted longer.
TEST(Prediction, GrowsWithTheJob) {
    auto predicted = [](int samples, const std::string& incident, double target, const std::string& albedo) {
        const Job job =
            parse_job(R"({"surface": {"generate": "gaussian", "samples": )" + std::to_string(samples) +
                          R"(, "pitch": "1 um", "correlation_length": "8 um", "rms_slope": 0.7},
            "material": {"model": "lambertian", "albedo": )" +
                          albedo + R"(},
            "measure": {"kind": "brdf", "incident": )" +
                          incident + R"(, "outgoing": {"hemisphere": 64}},
            "accuracy": {"target_relative_error": )" +
                          std::to_string(target) + "}}",
                      {});
        const LoadedSurface surface = load_surface(job.surface);
        return predict_brdf(surface.surface, load_material(job.material, job.surface, surface),
                            std::get<BrdfPlan>(job.plan));
    };
    const Prediction small = predicted(64, R"({"hemisphere": 4})", 0.01, "0.5"),
                     wide = predicted(64, R"({"hemisphere": 16})", 0.01, "[0.5, 0.5, 0.5]"),
                     large = predicted(128, R"({"hemisphere": 4})", 0.01, "0.5"),
                     exact = predicted(64, R"({"hemisphere": 4})", 0.0005, "0.5");
    EXPECT_DOUBLE_EQ(small.table_bytes, 4 * 64 * 3 * sizeof(double));
    EXPECT_DOUBLE_EQ(wide.table_bytes, 12 * small.table_bytes);
    EXPECT_GT(wide.cpu_seconds, small.cpu_seconds);
    EXPECT_GT(large.cpu_seconds, 2 * small.cpu_seconds);
    EXPECT_GT(large.memory_bytes, small.memory_bytes);
    EXPECT_GT(exact.cpu_seconds, 1.5 * small.cpu_seconds);
}

}  // namespace
}  // namespace gonio
