// The job document: what is accepted, what is refused and where, what its hash depends on, how its files are
// loaded.
#include "server/job.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>

#include "base/error.h"
#include "server/compose_job.h"
#include "server/job_hash.h"
#include "server/json_node.h"
#include "server/lengths.h"
#include "server/load_job.h"
#include "server/run_job.h"

namespace gonio {
namespace {

using nlohmann::json;

std::string read_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

// The error of an action that must fail.
Error error_of(const std::function<void()>& action) {
    try {
        action();
    } catch (const Error& error) {
        return error;
    }
    ADD_FAILURE() << "nothing was refused";
    return {ErrorCode::internal, "", "", ""};
}

Error parse_error(const std::string& text) {
    return error_of([&] { parse_job(text, {}); });
}

const json& documents() {
    static const json list = json::parse(read_file(GONIO_TEST_DATA "/end_to_end/job_documents.json"));
    return list;
}

json base_document(const json& merge = json::object()) {
    json document = documents()["base"];
    document.merge_patch(merge);
    return document;
}

Job parse(const json& document) {
    return parse_job(document.dump(), {});
}

const BrdfPlan& plan_of(const Job& job) {
    return std::get<BrdfPlan>(job.plan);
}

std::string hash_of(const json& document) {
    return load_job(parse(document)).hash;
}

// ---- lengths

TEST(Lengths, UnitsAreExactPowersOfTen) {
    EXPECT_EQ(parse_length("50 mm", ""), 0.05);
    EXPECT_EQ(parse_length("5um", ""), 5e-6);
    EXPECT_EQ(parse_length("5 \u00b5m", ""), 5e-6);
    EXPECT_EQ(parse_length("5 \u03bcm", ""), 5e-6);
    EXPECT_EQ(parse_length("3e-6 m", ""), 3e-6);
    EXPECT_EQ(parse_length("10 nm", ""), 1e-8);
    EXPECT_EQ(parse_length("250 pm", ""), 2.5e-10);
    EXPECT_EQ(parse_length("1.5E+2 cm", ""), 1.5);
    EXPECT_EQ(parse_length(".5 km", ""), 500);
    EXPECT_EQ(parse_length("-2. mm", ""), -0.002);
    // One rounding: 0.9 * 1e-3 is not 0.0009.
    EXPECT_NE(0.9 * 1e-3, 0.0009);
    EXPECT_EQ(parse_length("0.9 mm", ""), 0.0009);
    EXPECT_FALSE(std::signbit(parse_length("-0 mm", "")));
}

TEST(Lengths, RefusesWhatIsNoLength) {
    EXPECT_EQ(error_of([] { parse_length("50", "/w"); }).code(), ErrorCode::missing_unit);
    EXPECT_EQ(error_of([] { parse_length("50  ", "/w"); }).code(), ErrorCode::missing_unit);
    for (const char* text :
         {"", "mm", "5 mm ", " 5 mm", "5 m m", "5 Mm", "5 inch", "0x5 mm", "nan m", "inf m", "5e m", "--5 m",
          "5..0 m", "1e400 m", "1e-400 m", "1e99999999999 m", "5\tmm", "1,5 mm"}) {
        const Error error = error_of([&] { parse_length(text, "/w"); });
        EXPECT_EQ(error.code(), ErrorCode::invalid_input) << text;
        EXPECT_EQ(error.field(), "/w");
        EXPECT_NE(std::string(error.what()).find("nm"), std::string::npos)
            << "names the units: " << error.what();
    }
}

TEST(Lengths, FormatReadsBack) {
    EXPECT_EQ(format_length(3.90625e-8), "39.06 nm");
    EXPECT_EQ(format_length(0.05), "50 mm");
    EXPECT_EQ(format_length(0), "0 m");
    EXPECT_EQ(format_length(-1234), "-1.234 km");
    EXPECT_EQ(format_length(1e-3), "1 mm");
    for (const double metres : {3e-12, 4.2e-7, 1e-6, 0.999, 31900.0}) {
        EXPECT_NEAR(parse_length(format_length(metres), "") / metres, 1, 1e-3) << format_length(metres);
    }
}

// ---- strict JSON

TEST(StrictJson, RefusesDoubledKeysWithTheirPath) {
    const Error error =
        error_of([] { parse_json_strictly(R"({"a": {"b~/": 1, "c": {"b~/": 2}, "b~/": 3}})"); });
    EXPECT_EQ(error.field(), "/a/b~0~1");
    EXPECT_NO_THROW(parse_json_strictly(R"([{"a": 1}, {"a": 2}])"));
}

TEST(StrictJson, RefusesDepthNanInfinityGarbage) {
    EXPECT_EQ(error_of([] { parse_json_strictly(std::string(100000, '[')); }).code(),
              ErrorCode::invalid_input);
    EXPECT_NO_THROW(parse_json_strictly(std::string(16, '[') + std::string(16, ']')));
    EXPECT_THROW(parse_json_strictly(std::string(17, '[') + std::string(17, ']')), Error);
    for (const char* text :
         {"", "{", "NaN", "[Infinity]", "1e999", "{} {}", "{'a': 1}", "[1,]", "// no\n1", "\"\xff\"", "01"}) {
        const Error error = error_of([&] { parse_json_strictly(text); });
        EXPECT_EQ(error.code(), ErrorCode::invalid_input) << text;
    }
    EXPECT_NE(std::string(error_of([] { parse_json_strictly("{\n  \"a\" 1}"); }).what()).find("line 2"),
              std::string::npos);
    EXPECT_EQ(error_of([] { parse_json_strictly("[1, 2]", {.max_bytes = 5}); }).code(), ErrorCode::limit);
}

// ---- documents

TEST(JobDocument, IsJudgedAsListed) {
    ASSERT_GT(documents()["cases"].size(), 100u);
    for (const json& one : documents()["cases"]) {
        const std::string text = base_document(one["merge"]).dump();
        const std::string name = one["name"];
        if (one["refused_at"].is_null()) {
            EXPECT_NO_THROW(parse_job(text, {})) << name;
        } else {
            const Error error = parse_error(text);
            EXPECT_EQ(error.field(), one["refused_at"].get<std::string>()) << name << ": " << error.what();
            EXPECT_TRUE(error.code() == ErrorCode::invalid_input || error.code() == ErrorCode::missing_unit)
                << name;
        }
    }
}

TEST(JobDocument, SaysWhatWasMeant) {
    const auto message = [](const json& merge) {
        return std::string(parse_error(base_document(merge).dump()).what());
    };
    EXPECT_NE(message({{"surface", {{"perod", "2 mm"}}}}).find("did you mean \"period\"?"),
              std::string::npos);
    EXPECT_NE(message({{"surface", {{"generate", "v_grove"}}}}).find("did you mean \"v_groove\"?"),
              std::string::npos);
    EXPECT_NE(message({{"acuracy", json::object()}}).find("did you mean \"accuracy\"?"), std::string::npos);
    // Nothing is near: the allowed keys alone.
    const std::string far = message({{"zzzzzzzz", 1}});
    EXPECT_EQ(far.find("did you mean"), std::string::npos);
    EXPECT_NE(far.find("surface, base, material, environment, measure, accuracy, output"), std::string::npos);
    EXPECT_EQ(message({{"surface", {{"period", 2}}}}),
              "/surface/period = 2: a length needs a unit: one of km, m, cm, mm, um, nm, pm, as in \"2 mm\"");
    EXPECT_EQ(parse_error(base_document({{"surface", {{"period", 2}}}}).dump()).code(),
              ErrorCode::missing_unit);
    // Whatever stands in a document, a message stays readable.
    EXPECT_LT(message({{"surface", {{"generate", std::string(100000, 'x')}}}}).size(), 500u);
    EXPECT_LT(message({{"material", {{"albedo", json(std::vector<int>(100000, 1))}}}}).size(), 500u);
}

TEST(JobDocument, DefaultsAreFilledIn) {
    const Job job = parse(base_document());
    const Accuracy& accuracy = plan_of(job).accuracy;
    EXPECT_EQ(accuracy.target_relative_error, 0.01);
    EXPECT_FALSE(accuracy.max_seconds || accuracy.samples);
    EXPECT_EQ(accuracy.seed, 1u);
    EXPECT_EQ(plan_of(job).max_order, 0);
    EXPECT_FALSE(plan_of(job).separate_orders);
    ASSERT_EQ(job.outputs.size(), 1u);
    EXPECT_EQ(job.outputs[0].format, "csv");
    EXPECT_EQ(parse_job(base_document().dump(), {"lava", "."}).outputs[0].path, "lava.csv");
    EXPECT_EQ(
        parse_job(base_document({{"output", {{{"format", "exr"}}}}}).dump(), {"lava", "."}).outputs[0].path,
        "lava.exr");
    // A budget alone does not bring the default target with it.
    EXPECT_FALSE(
        plan_of(parse(base_document({{"accuracy", {{"max_seconds", 3}}}}))).accuracy.target_relative_error);
    const auto samples =
        plan_of(parse(base_document({{"accuracy", {{"samples", {{"directions", 7}}}}}}))).accuracy.samples;
    ASSERT_TRUE(samples);
    EXPECT_EQ(samples->directions, 7);
    EXPECT_EQ(samples->sub_samples, 1);
    EXPECT_EQ(samples->refinement, 1);
    EXPECT_EQ(samples->replicates, 8);
}

TEST(JobDocument, EveryOptionOfAFileArrives) {
    const json surface = {{"file", "a/b.png"},      {"width", "50 mm"},       {"depth", "25 mm"},
                          {"pitch_x", "1 um"},      {"pitch_y", "2 um"},      {"invert", true},
                          {"y_axis", "up"},         {"crop", {1, 2, 3, 4}},   {"height_offset", "-1 mm"},
                          {"level", "quadratic"},   {"boundary", "open"},     {"resample", {5, 6}},
                          {"height_range", "5 mm"}, {"height_scale", "1 nm"}, {"missing", "interpolate"}};
    json document = base_document();
    document["surface"] = surface;
    const Job job = parse_job(document.dump(), {"x", "jobs"});
    const auto& file = std::get<FileSurface>(job.surface);
    EXPECT_EQ(file.path, "jobs/a/b.png");
    const PrepareOptions& o = file.options;
    EXPECT_EQ(o.width, 0.05);
    EXPECT_EQ(o.depth, 0.025);
    EXPECT_EQ(o.pitch_x, 1e-6);
    EXPECT_EQ(o.pitch_y, 2e-6);
    EXPECT_EQ(o.height_range, 0.005);
    EXPECT_EQ(o.height_scale, 1e-9);
    EXPECT_EQ(o.height_offset, -0.001);
    EXPECT_TRUE(o.invert);
    EXPECT_EQ(o.y_up, true);
    EXPECT_EQ(o.crop, (std::array<int, 4>{1, 2, 3, 4}));
    EXPECT_EQ(o.resample, (std::array<int, 2>{5, 6}));
    EXPECT_EQ(o.level, Level::quadratic);
    EXPECT_EQ(o.boundary, Boundary::open);
    EXPECT_EQ(o.missing, Missing::interpolate);
    document["surface"]["file"] = "/absolute.png";
    EXPECT_EQ(std::get<FileSurface>(parse_job(document.dump(), {"x", "jobs"}).surface).path, "/absolute.png");
}

TEST(JobDocument, EveryChoiceIsTheOneNamed) {
    const auto options = [](const char* key, const char* choice) {
        json document = base_document();
        document["surface"] = {{"file", "a.png"}, {key, choice}};
        return std::get<FileSurface>(parse(document).surface).options;
    };
    EXPECT_EQ(options("level", "none").level, Level::none);
    EXPECT_EQ(options("level", "mean").level, Level::mean);
    EXPECT_EQ(options("level", "plane").level, Level::plane);
    EXPECT_EQ(options("level", "quadratic").level, Level::quadratic);
    EXPECT_EQ(options("boundary", "periodic").boundary, Boundary::periodic);
    EXPECT_EQ(options("boundary", "mirror").boundary, Boundary::mirror);
    EXPECT_EQ(options("boundary", "open").boundary, Boundary::open);
    EXPECT_EQ(options("missing", "reject").missing, Missing::reject);
    EXPECT_EQ(options("missing", "interpolate").missing, Missing::interpolate);
    EXPECT_EQ(options("y_axis", "down").y_up, false);
    EXPECT_FALSE(options("level", "none").y_up);
}

TEST(JobDocument, ChannelsAreNamed) {
    const auto channels = [](const json& albedo) {
        return parse(base_document({{"material", {{"albedo", albedo}}}})).material.material.channels;
    };
    EXPECT_EQ(channels(0.5), std::vector<std::string>{"y"});
    EXPECT_EQ(channels({0.1, 0.2, 0.3}), (std::vector<std::string>{"r", "g", "b"}));
    EXPECT_EQ(channels({{"wavelengths_nm", {450, 550.5}}, {"values", {0, 1}}}),
              (std::vector<std::string>{"450nm", "550.5nm"}));
}

TEST(JobDocument, PairsKeepTheirRows) {
    const Job job = parse(base_document(
        {{"measure",
          {{"incident", nullptr},
           {"outgoing", nullptr},
           {"pairs_deg", {{30, 0, 10, 0}, {60, 0, 10, 0}, {30, 0, 20, -0.0}, {30, 0, 10, 0}}}}}}));
    const BrdfPlan& plan = plan_of(job);
    EXPECT_EQ(plan.incident, (std::vector<AnglesDeg>{{30, 0}, {60, 0}}));
    EXPECT_EQ(plan.outgoing, (std::vector<AnglesDeg>{{10, 0}, {20, 0}}));
    EXPECT_EQ(plan.pairs, (std::vector<std::pair<int, int>>{{0, 0}, {1, 0}, {0, 1}, {0, 0}}));
}

TEST(JobDocument, AMillionPairsTakeSeconds) {
    std::string pairs;
    for (int r = 0; r < 1000000; ++r) {
        pairs += (r ? ",[" : "[") + std::to_string(r % 89) + "," + std::to_string(r % 360) + "," +
                 std::to_string(r / 20000) + ",0]";
    }
    const std::string text =
        R"({"surface": {"generate": "plane", "samples": 1, "pitch": "1 m"}, "material": {"model": "lambertian", "albedo": 1},
            "measure": {"kind": "brdf", "pairs_deg": [)" +
        pairs + "]}}";
    const Job job = parse_job(text, {});
    EXPECT_EQ(plan_of(job).pairs.size(), 1000000u);
    EXPECT_EQ(plan_of(job).incident.size(), 89u * 360u);
    EXPECT_EQ(plan_of(job).outgoing.size(), 50u);
}

TEST(JobDocument, RefusesMorePairsThanATableMayHave) {
    const json all = {{"theta_deg", nullptr}, {"phi_deg", nullptr}, {"hemisphere", 1 << 20}};
    const Error error =
        parse_error(base_document({{"measure", {{"incident", all}, {"outgoing", all}}}}).dump());
    EXPECT_EQ(error.code(), ErrorCode::limit);
    EXPECT_EQ(error.field(), "/measure");
}

TEST(JobDocument, SurfaceAloneIsForInfo) {
    EXPECT_NO_THROW(
        parse_surface_job(R"({"surface": {"generate": "plane", "samples": 2, "pitch": "1 m"}})", {}));
    EXPECT_EQ(error_of([] { parse_surface_job(base_document().dump(), {}); }).field(), "/material");
}

TEST(ComposeJob, WritesWhatItIsGiven) {
    const std::string text = compose_job({{"/surface/file", "a \"b\".png"},
                                          {"/output/0/path", "x"},
                                          {"/output/1/path", "y"},
                                          {"/material/albedo", "[0.5, 1]", true}});
    EXPECT_EQ(json::parse(text),
              json::parse(R"({"surface": {"file": "a \"b\".png"}, "output": [{"path": "x"}, {"path": "y"}],
                                                 "material": {"albedo": [0.5, 1]}})"));
    EXPECT_EQ(error_of([] {
                  compose_job({{"/measure/max_order", "al l", true}});
              }).field(),
              "/measure/max_order");
}

// ---- hashes

TEST(JobHash, DoesNotDependOnSpelling) {
    const json document = base_document();
    const std::string hash = hash_of(document);
    EXPECT_EQ(hash.size(), 64u);
    EXPECT_EQ(hash_of(base_document({{"surface", {{"period", "0.002 m"}}}})), hash);
    EXPECT_EQ(hash_of(base_document({{"surface", {{"period", "2000um"}}}})), hash);
    EXPECT_EQ(hash_of(base_document({{"accuracy", {{"target_relative_error", 0.01}, {"seed", 1}}}})), hash);
    EXPECT_EQ(hash_of(base_document(
                  {{"measure", {{"max_order", "all"}, {"orders", "sum"}, {"transport", "auto"}}}})),
              hash);
    EXPECT_EQ(hash_of(base_document({{"output", {{{"format", "exr"}, {"path", "elsewhere.exr"}}}}})), hash);
    EXPECT_EQ(hash_of(base_document({{"base", {{"kappa_1", 0}, {"kappa_2", 0}, {"direction_deg", 7}}}})),
              hash);
    // Another order of the keys.
    EXPECT_EQ(
        load_job(
            parse_job(R"({"measure": {"outgoing": {"phi_deg": [0, 180], "theta_deg": [0, 60]}, "kind": "brdf",
                                                  "incident": {"phi_deg": [0.0], "theta_deg": [0, 3e1]}},
                                      "material": {"albedo": 0.80, "model": "lambertian"},
                                      "surface": {"samples": 128, "period": "2 mm", "slope_deg": 45, "generate": "v_groove"}})",
                      {}))
            .hash,
        hash);
    // The same directions by another form.
    EXPECT_EQ(hash_of(base_document(
                  {{"measure",
                    {{"incident",
                      {{"theta_deg", nullptr}, {"phi_deg", nullptr}, {"list_deg", {{0, 0}, {30, 0}}}}}}}})),
              hash);
}

TEST(JobHash, DependsOnWhateverDecidesTheResult) {
    std::vector<std::string> hashes{hash_of(base_document())};
    for (const json& merge : std::vector<json>{
             {{"surface", {{"period", "2.001 mm"}}}},
             {{"surface", {{"slope_deg", 44}}}},
             {{"base", {{"kappa_1", 20}, {"kappa_2", 0}}}},
             {{"base", {{"kappa_1", 20}, {"kappa_2", 20}}}},
             {{"base", {{"kappa_1", 20}, {"kappa_2", 0}, {"correction", "exact"}}}},
             {{"base", {{"kappa_1", 20}, {"kappa_2", 0}, {"correction", "printed"}}}},
             {{"base", {{"kappa_1", 20}, {"kappa_2", 0}, {"direction_deg", 30}}}},
             {{"material", {{"albedo", 0.7}}}},
             {{"material", {{"albedo", {0.8, 0.8, 0.8}}}}},
             {{"measure", {{"incident", {{"theta_deg", {0, 31}}}}}}},
             {{"measure",
               {{"outgoing", {{"theta_deg", {60, 0}}}}}}},  // another order of rows is another table
             {{"measure", {{"max_order", 2}}}},
             {{"measure", {{"transport", "diffuse"}}}},
             {{"measure", {{"orders", "separate"}}}},
             {{"accuracy", {{"seed", 2}}}},
             {{"accuracy", {{"target_relative_error", 0.02}}}},
             {{"accuracy", {{"max_seconds", 10}}}},
             {{"accuracy", {{"samples", json::object()}}}},
         }) {
        hashes.push_back(hash_of(base_document(merge)));
    }
    const Job job = parse(base_document());
    hashes.push_back(load_job(job, ReferenceOptions{64}).hash);
    hashes.push_back(load_job(job, ReferenceOptions{65}).hash);
    std::sort(hashes.begin(), hashes.end());
    EXPECT_EQ(std::unique(hashes.begin(), hashes.end()), hashes.end());
}

TEST(LoadJob, RefusesBasesThatTheReliefDoesNotFit) {
    const auto refused = [](double kappa) {
        return error_of([&] {
            load_job(parse(base_document({{"base", {{"kappa_1", 0}, {"kappa_2", kappa}}}})));
        });
    };
    // Half a millimetre up and down, cells of 16 micrometres.
    for (const double kappa : {1100.0, -1100.0}) {
        EXPECT_EQ(refused(kappa).field(), "/base/kappa_2");
        EXPECT_NE(refused(kappa).allowed().find("at most 1000 1/m"), std::string::npos)
            << refused(kappa).allowed();
    }
    const auto load = [](double kappa) {
        return load_job(parse(base_document({{"base", {{"kappa_1", 0}, {"kappa_2", kappa}}}})));
    };
    EXPECT_EQ(load(900).surface.surface.base.kappa_2, 900);
    EXPECT_FALSE(load(900).surface.warnings.empty());
    EXPECT_FALSE(load(-100).surface.warnings.empty());
    EXPECT_TRUE(load(10).surface.warnings.empty());
}

TEST(JobHash, OfItsRunsLeavesOutWhenToStop) {
    const auto runs_of = [](const json& merge) { return load_job(parse(base_document(merge))).runs_hash; };
    const std::string runs = runs_of(json::object());
    EXPECT_EQ(runs_of({{"accuracy", {{"target_relative_error", 0.002}}}}), runs);
    EXPECT_EQ(runs_of({{"accuracy", {{"max_seconds", 3}}}}), runs);
    EXPECT_NE(runs_of({{"accuracy", {{"seed", 2}}}}), runs);
    EXPECT_NE(runs_of({{"measure", {{"max_order", 2}}}}), runs);
    EXPECT_NE(runs, hash_of(base_document()));
}

TEST(JobHash, NamesTheProgramThatComputes) {
    const LoadedJob loaded = load_job(parse(base_document()));
    const json canonical = json::parse(canonical_job(loaded.surface.hash, loaded.material, loaded.job.plan));
    EXPECT_EQ(canonical.value("engine", ""), program_version());
    EXPECT_EQ(canonical.value("surface", ""), loaded.surface.hash);
}

TEST(JobHash, NamesFilesByContent) {
    const std::filesystem::path folder =
        std::filesystem::path(testing::TempDir()) / ("gonio_job_test_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    const auto hash_of_file = [&](const std::string& name, const std::string& content) {
        std::ofstream(folder / name) << content;
        json document = base_document();
        document["surface"] = {{"file", name}, {"pitch", "1 mm"}, {"height_scale", "1 mm"}};
        return load_job(parse_job(document.dump(), {"x", folder.string()})).hash;
    };
    const std::string hash = hash_of_file("a.txt", "0 1\n1 2\n");
    EXPECT_EQ(hash_of_file("b.txt", "0 1\n1 2\n"), hash);
    EXPECT_NE(hash_of_file("b.txt", "0 1\n1 3\n"), hash);
    std::filesystem::remove_all(folder);
}

TEST(JobHash, IsFoundInTheHeadOfAResult) {
    const std::string path = testing::TempDir() + "gonio_is_result_of_" + std::to_string(::getpid()) + ".csv",
                      hash(64, 'a');
    std::ofstream(path) << "# job_hash: " << hash << "\n";
    EXPECT_TRUE(is_result_of(path, hash));
    EXPECT_FALSE(is_result_of(path, std::string(64, 'b')));
    EXPECT_FALSE(is_result_of(path + ".not_there", hash));
    EXPECT_FALSE(is_result_of(testing::TempDir(), hash));
    std::filesystem::remove(path);
}

// ---- loading

TEST(LoadJob, GeneratorErrorsCarryThePath) {
    EXPECT_EQ(error_of([] {
                  hash_of(base_document({{"surface", {{"samples", 127}}}}));
              }).field(),
              "/surface/samples");
}

TEST(LoadJob, MissingFileIsNotFound) {
    json document = base_document();
    document["surface"] = {{"file", "not_there.png"}, {"width", "1 mm"}, {"height_range", "1 mm"}};
    EXPECT_EQ(error_of([&] { load_job(parse(document)); }).code(), ErrorCode::not_found);
}

TEST(LoadJob, UnitsThatTheFileLacksAreNamed) {
    json document = base_document();
    document["surface"] = {{"grid", {{0, 1}, {2, 3}}}, {"height_scale", "1 mm"}};
    const Error error = error_of([&] { load_job(parse(document)); });
    EXPECT_EQ(error.code(), ErrorCode::missing_unit);
    EXPECT_EQ(error.field().rfind("/surface/", 0), 0u) << error.field();
}

TEST(LoadJob, InlineGridIsTheSurface) {
    json document = base_document();
    document["surface"] = {
        {"grid", {{0, 1, 2}, {3, 4, 5}}}, {"pitch_x", "1 mm"}, {"pitch_y", "2 mm"}, {"height_scale", "1 um"}};
    const HeightField surface = load_job(parse(document)).surface.surface;
    ASSERT_EQ(surface.nx, 3);
    ASSERT_EQ(surface.ny, 2);
    EXPECT_EQ(surface.pitch_x, 1e-3);
    EXPECT_EQ(surface.pitch_y, 2e-3);
    for (int k = 0; k < 6; ++k) EXPECT_NEAR(surface.at(k % 3, k / 3) + surface.mean_height, k * 1e-6, 1e-12);
}

// A map of the numbers 0, 0.1, 0.2, ... written as text, whose row 0 lies at y = 0 as the grid's does.
class AlbedoMap : public testing::Test {
  protected:
    void SetUp() override {
        std::filesystem::create_directories(folder_);
        std::ofstream(folder_ / "map.txt") << "0 0.1 0.2\n0.3 0.4 0.5\n";
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }

    Parameter load(const json& surface_options, const std::string& map = "map.txt") const {
        json document = base_document({{"material", {{"albedo", {{"file", map}}}}}});
        document["surface"] = {{"grid", {{0, 1, 2}, {3, 4, 5}}}, {"pitch", "1 mm"}, {"height_scale", "1 um"}};
        document["surface"].update(surface_options);
        const LoadedJob loaded = load_job(parse_job(document.dump(), {"x", folder_.string()}));
        const Parameter map_of_cells = pure_lambertian(loaded.material)->albedo;
        EXPECT_EQ(map_of_cells.map_nx, loaded.surface.surface.nx);
        EXPECT_EQ(map_of_cells.map_ny, loaded.surface.surface.ny);
        return map_of_cells;
    }
    static void expect_map(const Parameter& albedo, const std::vector<double>& expected) {
        ASSERT_EQ(albedo.map.size(), expected.size());
        for (size_t k = 0; k < expected.size(); ++k) EXPECT_NEAR(albedo.map[k], expected[k], 1e-7) << k;
    }

    std::filesystem::path folder_ =
        std::filesystem::path(testing::TempDir()) / ("gonio_albedo_map_" + std::to_string(::getpid()));
};

TEST_F(AlbedoMap, FollowsTheSurface) {
    expect_map(load(json::object()), {0, 0.1, 0.2, 0.3, 0.4, 0.5});
    expect_map(load({{"y_axis", "down"}}), {0.3, 0.4, 0.5, 0, 0.1, 0.2});
    expect_map(load({{"crop", {1, 0, 2, 2}}}), {0.1, 0.2, 0.4, 0.5});
    expect_map(load({{"invert", true}, {"level", "plane"}, {"height_offset", "1 m"}}),
               {0, 0.1, 0.2, 0.3, 0.4, 0.5});
}

TEST_F(AlbedoMap, MirrorsCellsAndNotNodes) {
    // Cell k lies between nodes k and k + 1. Nodes go 0 1 2 2 1 0, so cells go 0 1 (flat) 1 0 (flat).
    const Parameter albedo = load({{"boundary", "mirror"}});
    ASSERT_EQ(albedo.map_nx, 6);
    ASSERT_EQ(albedo.map_ny, 4);
    const double row0[] = {0, 0.1, 0.2, 0.1, 0, 0}, row1[] = {0.3, 0.4, 0.5, 0.4, 0.3, 0.3};
    for (int i = 0; i < 6; ++i) {
        EXPECT_NEAR(albedo.map[i], row0[i], 1e-7);
        EXPECT_NEAR(albedo.map[6 + i], row1[i], 1e-7);
        EXPECT_NEAR(albedo.map[12 + i], row0[i], 1e-7);
    }
}

TEST_F(AlbedoMap, HasAFileForEachChannel) {
    std::ofstream(folder_ / "dark.txt") << "0 0 0.1\n0 0 0\n";
    const auto loaded = [&](const json& albedo) {
        json document = base_document({{"material", {{"albedo", albedo}}}});
        document["surface"] = {{"grid", {{0, 1, 2}, {3, 4, 5}}}, {"pitch", "1 mm"}, {"height_scale", "1 um"}};
        return load_job(parse_job(document.dump(), {"x", folder_.string()})).material;
    };
    const Material rgb = loaded({{"files", {"map.txt", "dark.txt", "map.txt"}}});
    EXPECT_EQ(rgb.channels, (std::vector<std::string>{"r", "g", "b"}));
    expect_map(pure_lambertian(rgb)->albedo,
               {0, 0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0.1, 0, 0, 0, 0, 0.1, 0.2, 0.3, 0.4, 0.5});
    const Material spectrum = loaded({{"wavelengths_nm", {450, 600}}, {"files", {"dark.txt", "map.txt"}}});
    EXPECT_EQ(spectrum.channels, (std::vector<std::string>{"450nm", "600nm"}));
    expect_map(pure_lambertian(spectrum)->albedo, {0, 0, 0.1, 0, 0, 0, 0, 0.1, 0.2, 0.3, 0.4, 0.5});
    EXPECT_THROW(loaded({{"files", {"map.txt", "dark.txt"}}}), Error);
    EXPECT_THROW(loaded({{"wavelengths_nm", {450, 600}}, {"files", {"map.txt"}}}), Error);
}

// Any number of a material may be a map; "alpha" is two of them, a weight one, and the range is that of the
// number.
TEST_F(AlbedoMap, OfEveryParameter) {
    std::ofstream(folder_ / "exponents.txt") << "0 1 20\n300 4000 5\n";
    std::ofstream(folder_ / "alphas.txt") << "1 0.1 0.2\n0.3 0.4 0.5\n";
    const auto loaded = [&](const json& material) {
        json document = base_document(json::object());
        document["material"] = material;
        document["surface"] = {{"grid", {{0, 1, 2}, {3, 4, 5}}}, {"pitch", "1 mm"}, {"height_scale", "1 um"}};
        return load_job(parse_job(document.dump(), {"x", folder_.string()})).material;
    };
    const json file = {{"file", "map.txt"}}, exponents = {{"file", "exponents.txt"}},
               alphas = {{"file", "alphas.txt"}};
    const Material phong = loaded({{"model", "phong"}, {"exponent", exponents}, {"albedo", file}});
    expect_map(std::get<Phong>(phong.lobes[0].lobe).albedo, {0, 0.1, 0.2, 0.3, 0.4, 0.5});
    EXPECT_NEAR(std::get<Phong>(phong.lobes[0].lobe).exponent.at(0, 1, 1), 4000, 1e-3);

    const json ggx_part = {{"weight", 0.5},
                           {"model", "ggx"},
                           {"alpha", alphas},
                           {"eta", alphas},
                           {"k", {3, 2, 1}}},
               mirror_part = {{"weight", file}, {"model", "mirror"}, {"reflectance", 1}};
    const Material mixture = loaded({{"model", "mixture"}, {"parts", json::array({ggx_part, mirror_part})}});
    const auto& ggx = std::get<Microfacet>(mixture.lobes[0].lobe);
    expect_map(ggx.alpha_x, {1, 0.1, 0.2, 0.3, 0.4, 0.5});
    expect_map(ggx.alpha_y, {1, 0.1, 0.2, 0.3, 0.4, 0.5});
    expect_map(ggx.reflectance.eta, {1, 0.1, 0.2, 0.3, 0.4, 0.5});
    expect_map(mixture.lobes[1].weight, {0, 0.1, 0.2, 0.3, 0.4, 0.5});
    EXPECT_EQ(mixture.channels.size(), 3u);

    const Error range = error_of([&] { loaded({{"model", "ggx"}, {"alpha", file}, {"reflectance", 1}}); });
    EXPECT_EQ(range.field(), "/material/alpha");
    EXPECT_EQ(range.value(), "0");
    const json heavy = {{"weight", 0.6}, {"model", "phong"}, {"exponent", 2}, {"albedo", 1}};
    EXPECT_EQ(error_of([&] {
                  loaded({{"model", "mixture"}, {"parts", json::array({heavy, mirror_part})}});
              }).field(),
              "/material/parts");
}

TEST_F(AlbedoMap, ChangesTheHashOfTheJob) {
    const auto hash = [&] {
        json document = base_document({{"material", {{"albedo", {{"file", "map.txt"}}}}}});
        document["surface"] = {{"grid", {{0, 1, 2}, {3, 4, 5}}}, {"pitch", "1 mm"}, {"height_scale", "1 um"}};
        return load_job(parse_job(document.dump(), {"x", folder_.string()})).hash;
    };
    const std::string before = hash();
    std::ofstream(folder_ / "map.txt") << "0 0.1 0.2\n0.3 0.4 0.6\n";
    EXPECT_NE(hash(), before);
}

TEST_F(AlbedoMap, OfAnotherSizeOrRangeIsRefused) {
    std::ofstream(folder_ / "small.txt") << "0 0.1\n0.3 0.4\n";
    std::ofstream(folder_ / "bright.txt") << "0 0.1 0.2\n0.3 0.4 1.5\n";
    const Error size = error_of([&] { load(json::object(), "small.txt"); });
    EXPECT_EQ(size.field(), "/material/albedo");
    EXPECT_EQ(size.value(), "2 x 2");
    const Error range = error_of([&] { load(json::object(), "bright.txt"); });
    EXPECT_EQ(range.value(), "1.5");
    EXPECT_NE(std::string(range.what()).find("column 2, row 1"), std::string::npos);
}

// ---- materials

TEST(MaterialJob, MetalsHaveTheIndexOfTheirChannels) {
    const auto material = [](const json& m) {
        json document = base_document(json::object());
        document["material"] = m;
        return parse_job(document.dump(), {}).material.material;
    };
    const Material rgb = material({{"model", "mirror"}, {"metal", "Au"}});
    EXPECT_EQ(rgb.channels, (std::vector<std::string>{"r", "g", "b"}));
    const auto& index = std::get<Mirror>(rgb.lobes[0].lobe).reflectance;
    EXPECT_LT(index.eta.at(0, 0, 0), 0.25);
    EXPECT_GT(index.eta.at(2, 0, 0), 1.2);
    const json iron_part = {{"weight", 0.5}, {"model", "ggx"}, {"alpha", 0.3}, {"metal", "Fe"}},
               paint = {{"weight", 0.5},
                        {"model", "lambertian"},
                        {"albedo", {{"wavelengths_nm", {549, 704}}, {"values", {0.1, 0.2}}}}};
    const Material spectrum = material({{"model", "mixture"}, {"parts", json::array({iron_part, paint})}});
    EXPECT_EQ(spectrum.channels, (std::vector<std::string>{"549nm", "704nm"}));
    const auto& iron = std::get<Microfacet>(spectrum.lobes[0].lobe).reflectance;
    EXPECT_NEAR(iron.eta.at(0, 0, 0), 2.95, 1e-9);
    EXPECT_NEAR(iron.k.at(1, 0, 0), 3.19, 1e-9);
}

// Every number of a material is in the name of the job; how it is written is not.
TEST(MaterialJob, HashTellsMaterialsApart) {
    const auto hash = [](const json& m) {
        json document = base_document(json::object());
        document["material"] = m;
        return load_job(parse_job(document.dump(), {})).hash;
    };
    const json ggx = {{"model", "ggx"}, {"alpha", 0.3}, {"reflectance", 1}};
    std::vector<std::string> names = {hash(ggx)};
    for (const json& change : {json{{"model", "beckmann"}}, json{{"alpha", 0.31}}, json{{"rotation_deg", 10}},
                               json{{"reflectance", 0.9}}, json{{"reflectance", nullptr}, {"metal", "Ag"}}}) {
        json other = ggx;
        other.merge_patch(change);
        EXPECT_EQ(std::count(names.begin(), names.end(), hash(other)), 0) << change;
        names.push_back(hash(other));
    }
    const json written_otherwise = {
        {"model", "ggx"}, {"alpha_x", 0.3}, {"alpha_y", 0.3}, {"rotation_deg", 0}, {"reflectance", 1}};
    EXPECT_EQ(hash(ggx), hash(written_otherwise));
    const json half = {{"weight", 0.5}, {"model", "lambertian"}, {"albedo", 0.8}};
    EXPECT_EQ(hash({{"model", "lambertian"}, {"albedo", 0.8}}),
              hash({{"model", "mixture"}, {"parts", json::array({half, half})}}));
}

// ---- outputs

TEST(Outputs, GoBelowTheFolder) {
    LoadedJob loaded{parse(base_document({{"output",
                                           {{{"format", "csv"}, {"path", "a/b.csv"}},
                                            {{"format", "json"}, {"path", "/c.json"}}}}})),
                     {},
                     {},
                     std::nullopt};
    EXPECT_EQ(output_files(loaded, "results")[0].path, "results/a/b.csv");
    EXPECT_EQ(output_files(loaded, ".")[0].path, "a/b.csv");
    EXPECT_EQ(output_files(loaded, "results")[1].path, "/c.json");
    loaded.reference = ReferenceOptions{};
    EXPECT_EQ(output_files(loaded, "results")[0].path, "results/a/b.reference.csv");
}

}  // namespace
}  // namespace gonio
