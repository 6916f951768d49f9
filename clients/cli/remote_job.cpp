#include "clients/cli/remote_job.h"

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <sstream>

#include "base/atomic_file.h"
#include "clients/cli/console.h"
#include "clients/cli/execute.h"
#include "clients/cli/interrupt.h"
#include "server/btf_file.h"
#include "server/json_node.h"
#include "server/measure_kind.h"
#include "server/service/temporary_folder.h"

namespace gonio {
namespace {

using nlohmann::json;

// {"file": path} becomes {"sha256": ...} of what was uploaded, here and further inside.
void upload_files(RemoteService& service, json& holder, const std::filesystem::path& folder) {
    if (holder.is_structured())
        for (json& member : holder) upload_files(service, member, folder);
    if (!holder.is_object()) return;
    auto uploaded = [&](const json& name) {
        return service.upload((folder / name.get<std::string>()).string());
    };
    if (holder.contains("file")) {
        holder["sha256"] = uploaded(holder["file"]);
        holder.erase("file");
    }
    if (holder.contains("files")) {
        json list = json::array();
        for (const json& name : holder["files"]) list.push_back(uploaded(name));
        holder["sha256"] = list;
        holder.erase("files");
    }
}

}  // namespace

void add_remote_options(CLI::App& command, RemoteOptions& remote) {
    command.add_option("--server", remote.server, "Address of a gonio service")->envname("GONIO_SERVER");
    command.add_option("--token-file", remote.token_file, "File with the token for it")
        ->envname("GONIO_TOKEN_FILE");
}

SubmittedJob submit_job(RemoteService& service, const std::string& path) {
    const std::string text = read_text(path);
    const std::filesystem::path file(path == "-" ? "gonio" : path);
    const std::filesystem::path folder = path == "-" ? "." : file.parent_path();
    SubmittedJob submitted{parse_job(text, {file.stem().string(), folder.string()}), {}};
    json inputs = parse_json_strictly(text);
    inputs.erase("output");
    for (const char* member : {"surface", "material", "environment"})
        if (inputs.contains(member)) upload_files(service, inputs[member], folder);
    submitted.info = service.submit(inputs["measure"].value("kind", "brdf"), inputs);
    return submitted;
}

json wait_with_bar(RemoteService& service, const std::string& job, const CommonOptions& common) {
    Monitor monitor;
    monitor.cancel_requested = &interrupt_requested();
    ProgressBar bar(common.quiet);
    monitor.on_progress = [&](const Progress& progress) { bar.update(progress); };
    try {
        return service.wait(job, monitor);
    } catch (const Error& error) {
        if (error.code() == ErrorCode::cancelled || error.code() == ErrorCode::unreachable)
            print_warning("the service goes on with it: gonio wait " + job + ", gonio cancel " + job);
        throw;
    }
}

int execute_remotely(const std::string& path, const RemoteOptions& remote, const CommonOptions& common) {
    RemoteService service = remote.service();
    const SubmittedJob submitted = submit_job(service, path);
    const std::string id = submitted.info.value("jobID", "");
    if (!common.quiet) std::cerr << "job " << id << " of " << remote.server << std::endl;
    const json info = wait_with_bar(service, id, common);
    if (info.value("status", "") == "dismissed") throw Error(ErrorCode::cancelled, id, "", "was cancelled");
    if (info.value("status", "") != "successful")
        throw Error(ErrorCode::internal, id, "", "failed: " + info.value("message", ""));
    for (const OutputRequest& output : submitted.job.outputs) {
        const std::filesystem::path file = std::filesystem::path(common.folder) / output.path;
        if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path());
        const std::string product = product_of(submitted.job.plan).name;
        const auto fetch_to = [&](const std::string& target, const std::string& format) {
            write_file_atomically(target,
                                  [&](std::ostream& out) { service.fetch(id, product, format, out); });
        };
        const auto form = image_form(output.format);
        if (form && service.has(id, product, "btf")) {  // a twentieth of the bytes
            const TemporaryFolder folder;
            const std::string factored = (folder.path() / "factored").string();
            fetch_to(factored, "btf");
            expand_btf(factored, *form, file.lexically_normal().string(), {{}, &interrupt_requested()});
        } else {
            fetch_to(file.lexically_normal().string(), output.format);
        }
        if (!common.quiet) std::cerr << "wrote " << file.lexically_normal().string() << std::endl;
    }
    if (common.json) {
        std::ostringstream report;
        service.fetch(id, "report", "json", report);
        std::cout << report.str() << std::endl;
    }
    return 0;
}

}  // namespace gonio
