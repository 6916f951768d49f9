#include "server/service/untrusted.h"

#include <fcntl.h>
#include <seccomp.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "server/json_node.h"
#include "surface/io/formats.h"

namespace gonio {
namespace {

using nlohmann::json;

constexpr rlim_t child_seconds = 60, child_bytes = rlim_t{4} << 30;
constexpr size_t longest_head = 1 << 16;

bool is_untrusted_format(const std::string& path) {
    std::array<char, 4> head{};
    std::ifstream(path, std::ios::binary).read(head.data(), head.size());
    return std::string_view(head.data(), 4) == "\x76\x2f\x31\x01";
}

// ---- the child

std::string bytes_of_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

void set_limit(int what, rlim_t most) {
    const rlimit limit{most, most};
    if (::setrlimit(what, &limit) != 0) throw Error(ErrorCode::internal, "", "", "setrlimit failed");
}

void write_all(std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t n = ::write(STDOUT_FILENO, bytes.data(), bytes.size());
        if (n < 0) ::_exit(1);
        bytes.remove_prefix(static_cast<size_t>(n));
    }
}

template <class Number>
void answer(const json& head, const std::vector<Number>& numbers) {
    write_all(head.dump() + "\n");
    write_all({reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(Number)});
}

void answer_heights(const FileBytes& file) {
    const RawHeights heights = decode_heights(file, untrusted_limits);
    json head{{"nx", heights.nx},
              {"ny", heights.ny},
              {"row0_at_top", heights.row0_at_top},
              {"bits", heights.bits},
              {"integer_max", heights.integer_max},
              {"format", heights.format},
              {"notes", heights.notes}};
    if (heights.pitch_x) head["pitch_x"] = *heights.pitch_x;
    if (heights.pitch_y) head["pitch_y"] = *heights.pitch_y;
    if (heights.height_unit) head["height_unit"] = *heights.height_unit;
    answer(head, heights.values);
}

void answer_radiance(const FileBytes& file) {
    const RadianceImage image = decode_radiance_image(file, untrusted_limits);
    answer({{"nx", image.nx}, {"ny", image.ny}, {"n_channels", image.n_channels}}, image.values);
}

// ---- the parent: what comes back is a stranger's, too

std::optional<double> optional_number(const JsonNode& head, const char* key) {
    const auto node = head.find(key);
    return node ? std::optional(node->number()) : std::nullopt;
}

// One line of JSON, and numbers behind it.
struct Answer {
    std::string path, output;
    size_t line_end = 0;
    json head;

    template <class Number>
    std::vector<Number> numbers(size_t n) const {
        if (output.size() - line_end - 1 != n * sizeof(Number))
            throw Error(ErrorCode::invalid_input, path, "",
                        "the process that was to decode it ended early: damaged");
        std::vector<Number> values(n);
        std::memcpy(values.data(), output.data() + line_end + 1, n * sizeof(Number));
        return values;
    }
};

Answer checked_answer(const std::string& path, std::string output) {
    Answer answer{path, std::move(output), 0, {}};
    answer.line_end = answer.output.find('\n');
    if (answer.line_end == std::string::npos || answer.line_end > longest_head)
        throw Error(ErrorCode::invalid_input, path, "",
                    "the process that was to decode it was killed: damaged");
    answer.head = parse_json_strictly({answer.output.data(), answer.line_end}, {longest_head, 4});
    const JsonNode head(answer.head);
    if (head.has("refused")) {
        const JsonNode refused = head.at("refused");
        throw Error(
            static_cast<ErrorCode>(refused.at("code").whole_number(0, static_cast<int>(ErrorCode::internal))),
            path, refused.at("value").raw().get<std::string>(), refused.at("allowed").text());
    }
    return answer;
}

int extent(const JsonNode& node) {
    return static_cast<int>(node.whole_number(1, untrusted_limits.max_points));
}

RawHeights heights_from(const Answer& answer) {
    const JsonNode head(answer.head);
    RawHeights heights;
    heights.nx = extent(head.at("nx"));
    heights.ny = extent(head.at("ny"));
    heights.row0_at_top = head.at("row0_at_top").boolean();
    heights.bits = static_cast<int>(head.at("bits").whole_number(0, 64));
    heights.integer_max = head.at("integer_max").number();
    heights.format = head.at("format").text();
    heights.pitch_x = optional_number(head, "pitch_x");
    heights.pitch_y = optional_number(head, "pitch_y");
    heights.height_unit = optional_number(head, "height_unit");
    for (const json& note : head.at("notes").raw()) heights.notes.push_back(note.get<std::string>());
    heights.values = answer.numbers<double>(static_cast<size_t>(heights.nx) * heights.ny);
    return heights;
}

RadianceImage radiance_from(const Answer& answer) {
    const JsonNode head(answer.head);
    RadianceImage image;
    image.nx = extent(head.at("nx"));
    image.ny = extent(head.at("ny"));
    image.n_channels = static_cast<int>(head.at("n_channels").whole_number(1, 3));
    image.values = answer.numbers<float>(static_cast<size_t>(image.n_channels) * image.nx * image.ny);
    return image;
}

Answer answer_of_child(const std::string& content, const std::string& path) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw Error(ErrorCode::io, path, "", "no pipe to be had");
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    std::string program = "/proc/self/exe", command = "decode-untrusted", what = content, file = path;
    char* const arguments[] = {program.data(), command.data(), what.data(), file.data(), nullptr};
    // Nothing of ours to read there, and no threads of a library that it does not need.
    std::string one_thread = "OPENBLAS_NUM_THREADS=1";
    char* const environment[] = {one_thread.data(), nullptr};
    pid_t child = 0;
    const int failure = ::posix_spawn(&child, program.c_str(), &actions, nullptr, arguments, environment);
    posix_spawn_file_actions_destroy(&actions);
    ::close(ends[1]);
    std::string output;
    if (failure == 0) {
        const size_t most = longest_head + static_cast<size_t>(untrusted_limits.max_points) * sizeof(double);
        std::string piece(1 << 20, '\0');
        for (;;) {
            const ssize_t n = ::read(ends[0], piece.data(), piece.size());
            if (n < 0 && errno == EINTR) continue;
            if (n <= 0 || output.size() > most) break;
            output.append(piece.data(), static_cast<size_t>(n));
        }
    }
    ::close(ends[0]);
    if (failure != 0) throw Error(ErrorCode::io, path, "", "no process to decode it can be started");
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    return checked_answer(path, status == 0 ? std::move(output) : "");
}

}  // namespace

void give_up_system_calls() {
    const scmp_filter_ctx filter = seccomp_init(SCMP_ACT_KILL_PROCESS);
    bool ok = filter != nullptr;
    for (const int call :
         {SCMP_SYS(write), SCMP_SYS(brk), SCMP_SYS(munmap), SCMP_SYS(mremap), SCMP_SYS(madvise),
          SCMP_SYS(futex), SCMP_SYS(exit), SCMP_SYS(exit_group), SCMP_SYS(getrandom), SCMP_SYS(clock_gettime),
          SCMP_SYS(sched_yield), SCMP_SYS(rt_sigprocmask)})
        ok = ok && seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 0) == 0;
    // Memory that can be executed is not to be had.
    for (const int call : {SCMP_SYS(mmap), SCMP_SYS(mprotect)})
        ok =
            ok && seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 1,
                                   SCMP_A2(SCMP_CMP_MASKED_EQ, static_cast<scmp_datum_t>(PROT_EXEC), 0)) == 0;
    ok = ok && seccomp_load(filter) == 0;
    seccomp_release(filter);
    if (!ok) throw Error(ErrorCode::internal, "", "", "the system has no seccomp filter");
}

int decode_untrusted(const std::string& content, const std::string& path) {
    try {
        const std::string bytes = bytes_of_file(path);
        set_limit(RLIMIT_CPU, child_seconds);
        set_limit(RLIMIT_AS, child_bytes);
        set_limit(RLIMIT_CORE, 0);
        give_up_system_calls();
        content == "radiance" ? answer_radiance({path, bytes}) : answer_heights({path, bytes});
    } catch (const Error& error) {
        const json refused{
            {"code", static_cast<int>(error.code())}, {"value", error.value()}, {"allowed", error.allowed()}};
        write_all(json{{"refused", refused}}.dump(-1, ' ', false, json::error_handler_t::replace) + "\n");
    } catch (...) {
        ::_exit(1);
    }
    ::_exit(0);  // no destructor and no exit handler calls what is not allowed any more
}

RawHeights read_untrusted_heights(const std::string& path) {
    return is_untrusted_format(path) ? heights_from(answer_of_child("heights", path))
                                     : read_heights(path, untrusted_limits);
}

RadianceImage read_untrusted_radiance(const std::string& path) {
    return is_untrusted_format(path) ? radiance_from(answer_of_child("radiance", path))
                                     : read_radiance_image(path, untrusted_limits);
}

}  // namespace gonio
