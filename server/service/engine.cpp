#include "server/service/engine.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "server/json_node.h"
#include "server/result_json.h"
#include "table/io/table_io.h"

namespace gonio {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

// Checkpoints of one job in the store.
class StoredCheckpoints : public Checkpoints {
  public:
    StoredCheckpoints(Store& store, std::string job_hash) : store_(store), job_hash_(std::move(job_hash)) {}
    std::optional<std::string> load(const std::string& key) override {
        const std::optional<Checkpoint> saved = store_.load_checkpoint(job_hash_, key);
        if (!saved) return std::nullopt;
        std::ifstream in(store_.objects().path(saved->sha256), std::ios::binary);
        std::string bytes{std::istreambuf_iterator<char>(in), {}};
        // A damaged file is computed again.
        if (sha256_hex(bytes) != saved->sha256) return std::nullopt;
        return bytes;
    }
    void save(const std::string& key, const std::string& bytes) override {
        store_.save_checkpoint(job_hash_, key, store_.objects().put(bytes));
    }

  private:
    Store& store_;
    std::string job_hash_;
};

StoredObject put_file(Objects& objects, const std::string& path) {
    ObjectWriter writer = objects.writer();
    std::ifstream in(path, std::ios::binary);
    std::string piece(1 << 20, '\0');
    while (in.read(piece.data(), static_cast<std::streamsize>(piece.size())), in.gcount() > 0)
        writer.write({piece.data(), static_cast<size_t>(in.gcount())});
    return writer.finish();
}

constexpr std::pair<const char*, const char*> table_outputs[] = {
    {"csv", "text/csv"}, {"json", "application/json"}, {"exr", "image/x-exr"}};

// Gone with all that is in it, also when the disk was full.
class TemporaryFolder {
  public:
    TemporaryFolder() {
        std::string name = (std::filesystem::temp_directory_path() / "gonio-XXXXXX").string();
        if (!::mkdtemp(name.data())) throw Error(ErrorCode::io, name, "", "cannot be made");
        path_ = name;
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
};

// The table in every format, and the report.
std::vector<NewOutput> make_outputs(Objects& objects, const LoadedJob& loaded, const BrdfResult& result) {
    std::vector<NewOutput> outputs;
    const TemporaryFolder folder;
    for (const auto& [format, media_type] : table_outputs) {
        const std::string name = std::string("table.") + format, path = (folder.path() / name).string();
        write_table(result.table, format, path);
        outputs.push_back({name, media_type, put_file(objects, path)});
    }
    outputs.push_back(
        {"report.json", "application/json", objects.put(result_json(loaded, result.report, {}, {}))});
    return outputs;
}

}  // namespace

ServiceJob load_service_job(const std::string& document, Objects& objects) {
    json job = json::parse(document);
    ServiceJob result;
    const JsonNode root(job, "");
    const std::optional<JsonNode> surface = root.find("surface");
    if (surface && surface->raw().is_object()) {
        if (const auto file = surface->find("file"))
            file->refuse(R"(files of the server are not read: upload it and give its "sha256")");
        if (const auto named = surface->find("sha256")) {
            const std::string sha256 = named->text();
            if (!objects.exists(sha256))
                named->refuse("is no surface that was uploaded (PUT /surfaces/{sha256})");
            result.surfaces.push_back(sha256);
            job["surface"].erase("sha256");
            job["surface"]["file"] = objects.path(sha256);
        }
    }
    if (const auto material = root.find("material"); material && material->raw().is_object())
        if (const auto albedo = material->find("albedo"); albedo && albedo->raw().is_object())
            for (const char* key : {"file", "files"})
                if (const auto file = albedo->find(key)) file->refuse("files of the server are not read");
    std::optional<ReferenceOptions> reference;
    if (const auto traced = root.find("reference")) {
        traced->allow_keys({"paths"});
        reference = ReferenceOptions{static_cast<long long>(traced->at("paths").whole_number(1, 1 << 30))};
        job.erase("reference");
    }
    result.loaded = load_job(parse_job(job.dump(), {}), reference);
    return result;
}

Engine::Engine(Store& store, const EngineOptions& options)
    : store_(store), options_(options), worker_([this] { work(); }), watcher_([this] { watch(); }) {}

Engine::~Engine() {
    ending_ = true;
    cancel_ = true;
    worker_.join();
    watcher_.join();
}

void Engine::work() {
    uint64_t seen = store_.changes();
    while (!ending_) {
        try {
            const std::optional<ClaimedJob> claimed = store_.next_job();
            if (claimed) {
                compute(*claimed);
                continue;
            }
        } catch (const std::exception&) {  // the disk: the job stays where it is, and is tried again
            std::this_thread::sleep_for(500ms);
        }
        seen = store_.wait_for_change(seen, 500ms);
    }
}

// A running job that is dismissed must end within a second.
void Engine::watch() {
    while (!ending_) {
        std::this_thread::sleep_for(100ms);
        const std::lock_guard lock(current_mutex_);
        if (!current_hash_.empty() && store_.stop_requested(current_hash_)) cancel_ = true;
    }
}

void Engine::compute(const ClaimedJob& claimed) {
    const std::string& hash = claimed.job.job_hash;
    {
        const std::lock_guard lock(current_mutex_);
        current_hash_ = hash;
        cancel_ = ending_.load();
    }
    Monitor monitor;
    monitor.cancel_requested = &cancel_;
    monitor.on_progress = [&](const Progress& progress) {
        store_.progress(hash, std::clamp(static_cast<int>(100 * progress.fraction), 0, 99), progress.stage);
    };
    std::optional<Error> failure;
    try {
        const ServiceJob job = load_service_job(claimed.document, store_.objects());
        StoredCheckpoints checkpoints(store_, hash);
        RunOptions options;
        options.n_threads = options_.n_threads;
        options.max_bytes = options_.max_bytes;
        options.checkpoints = &checkpoints;
        const BrdfResult result = run_job(job.loaded, options, monitor);
        monitor.check_cancelled();
        store_.succeed(hash, make_outputs(store_.objects(), job.loaded, result));
    } catch (const Error& error) {
        failure = error;
    } catch (const std::bad_alloc&) {
        failure = Error(ErrorCode::limit, "", "", "out of memory");
    } catch (const std::exception& error) {
        failure = Error(ErrorCode::internal, "", "", error.what());
    }
    {
        const std::lock_guard lock(current_mutex_);
        current_hash_.clear();
    }
    if (!failure) return;
    if (failure->code() != ErrorCode::cancelled)
        store_.fail(hash, failure->what(), failure_json(*failure, {-1, ""}));
    else if (store_.stop_requested(hash))
        store_.stopped(hash);
    else
        store_.release(hash);
}

}  // namespace gonio
