// Sends bytes to the whole service over a socket: framing, routes, and every handler that reads a path, a
// query, a header or a body. The server must answer or close, never with 500, and still answer an honest
// request. In the input "JOB1" stands for the id of a job with a result, "SHA1" for the name of an uploaded
// surface: no fuzzer would guess them.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>

#include "server/service/api.h"
#include "server/service/page.h"
#include "server/service/temporary_folder.h"

namespace {

using namespace gonio;

ServiceLimits small_limits() {
    ServiceLimits limits;
    limits.document_bytes = 1 << 16;
    limits.surface_bytes = 1 << 16;
    limits.memory_bytes = 1 << 28;
    limits.queued_jobs = 20;
    return limits;
}

struct Service {
    TemporaryFolder folder;
    Store store{{(folder.path() / "data").string()}};
    JobTimes times;
    std::string failure;  // what a client may not see, and a fuzzer must
    http::GuardedServer server{
        {}, {{}, {}, [this](const http::Request&, const std::string& text) { failure = text; }}};
    Api api{store, server, small_limits(), times};
    std::string job, surface;
    int port = 0;

    Service() {
        add_page(server);
        const StoredObject object = store.objects().put("# Width: 1 um\n# Height: 1 um\n0 1\n1 0\n");
        surface = object.sha256;
        store.put_surface(object);
        NewJob one;
        one.process = "brdf";
        one.document = "{}";
        one.job_hash = "hash";
        job = store.accept(one).job.id;
        store.next_job();
        store.succeed("hash", {{"table.csv", "text/csv", store.objects().put("a,b\n")}});
        port = server.listen("127.0.0.1", 0);
    }

    std::string ask(const std::string& bytes) const {
        const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(static_cast<uint16_t>(port));
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
            __builtin_trap();
        // A server that has refused already may reset: no matter.
        static_cast<void>(!::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL));
        ::shutdown(socket, SHUT_WR);
        std::string answer;
        char piece[4096];
        for (ssize_t n = 0; (n = ::recv(socket, piece, sizeof piece, 0)) > 0;)
            answer.append(piece, static_cast<size_t>(n));
        ::close(socket);
        return answer;
    }
};

void replace_all(std::string& text, const std::string& what, const std::string& by) {
    for (size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
        text.replace(at, what.size(), by);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static Service service;
    std::string bytes(reinterpret_cast<const char*>(data), size);
    replace_all(bytes, "JOB1", service.job);
    replace_all(bytes, "SHA1", service.surface);
    const std::string answer = service.ask(bytes);
    if (!service.failure.empty()) {
        std::fprintf(stderr, "internal error: %s\n", service.failure.c_str());
        __builtin_trap();
    }
    if (!answer.empty() && answer.rfind("HTTP/1.1 ", 0) != 0) __builtin_trap();
    if (answer.rfind("HTTP/1.1 5", 0) == 0 && answer.rfind("HTTP/1.1 501", 0) != 0 &&
        answer.rfind("HTTP/1.1 505", 0) != 0) {
        std::fprintf(stderr, "%s\n", answer.c_str());
        __builtin_trap();
    }
    static int count = 0;
    if (++count % 64 == 0) {
        if (service.ask("GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
                .rfind("HTTP/1.1 200", 0) != 0)
            __builtin_trap();
        // Room for further jobs.
        JobFilter queued;
        queued.statuses = {JobStatus::accepted};
        queued.limit = 100;
        for (const StoredJob& job : service.store.list(queued)) service.store.dismiss(job.id);
    }
    return 0;
}
