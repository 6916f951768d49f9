/* LD_PRELOAD: fails the n-th call that changes a file. FAULT_AT=n (from 1), FAULT_ERRNO=ENOSPC|EIO, FAULT_ALL=1: that call and
 * all later ones (a disk that stays full). FAULT_CALL=rename (or write, pwrite, fsync, fdatasync): only such calls count.
 * FAULT_LOG names a file that gets "CALL PATH" when a call is failed; at a normal end the number of calls seen follows. Calls on
 * pipes and terminals do not count. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

static atomic_long seen;

static void record(const char* text) {
    const char* path = getenv("FAULT_LOG");
    if (!path) return;
    /* Raw system calls: the shim must not count, or fail, itself. */
    const int fd = (int)syscall(SYS_openat, AT_FDCWD, path, O_WRONLY | O_CREAT | O_APPEND, 0600);
    if (fd < 0) return;
    (void)!syscall(SYS_write, fd, text, strlen(text));
    syscall(SYS_close, fd);
}

static int fails(const char* call, const char* path) {
    const char *at = getenv("FAULT_AT"), *only = getenv("FAULT_CALL");
    if (only && strcmp(only, call) != 0) return 0;
    const long n = atomic_fetch_add(&seen, 1) + 1, first = at ? atol(at) : 0;
    if (first == 0 || n < first || (n > first && !getenv("FAULT_ALL"))) return 0;
    char line[4200];
    snprintf(line, sizeof line, "%s %s\n", call, path);
    record(line);
    const char* name = getenv("FAULT_ERRNO");
    errno = name && strcmp(name, "EIO") == 0 ? EIO : ENOSPC;
    return 1;
}

static int fails_fd(const char* call, int fd) {
    struct stat status;
    if (fstat(fd, &status) != 0 || !(S_ISREG(status.st_mode) || S_ISDIR(status.st_mode))) return 0;
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    const ssize_t length = readlink(link, path, sizeof path - 1);
    path[length < 0 ? 0 : length] = 0;
    return fails(call, path);
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

ssize_t write(int fd, const void* bytes, size_t count) {
    return fails_fd("write", fd) ? -1 : NEXT(write)(fd, bytes, count);
}
ssize_t pwrite(int fd, const void* bytes, size_t count, off_t offset) {
    return fails_fd("pwrite", fd) ? -1 : NEXT(pwrite)(fd, bytes, count, offset);
}
ssize_t pwrite64(int fd, const void* bytes, size_t count, off64_t offset) {
    return fails_fd("pwrite", fd) ? -1 : NEXT(pwrite64)(fd, bytes, count, offset);
}
int fsync(int fd) { return fails_fd("fsync", fd) ? -1 : NEXT(fsync)(fd); }
int fdatasync(int fd) { return fails_fd("fdatasync", fd) ? -1 : NEXT(fdatasync)(fd); }
int rename(const char* from, const char* to) { return fails("rename", to) ? -1 : NEXT(rename)(from, to); }

__attribute__((destructor)) static void report(void) {
    char line[64];
    snprintf(line, sizeof line, "calls %ld\n", atomic_load(&seen));
    record(line);
}
