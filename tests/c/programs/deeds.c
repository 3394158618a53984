/* A program of DHD that commands what no hand should feel, or harms its own process, in the way that its argument names: it pushes
 * with 2 N first, and with 6 N after a deed that it survives. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

static void *library;
static int (*open_device)(void), (*close_device)(signed char);
static int (*set)(double, double, double, double, double, double, signed char);

static int find(void *function, const char *name)
{
    void *found = dlsym(library, name);
    memcpy(function, &found, sizeof found);
    return found == NULL;
}

static void push(double force_n, int calls)
{
    for (int call = 0; call < calls; call++)
        set(0.0, 0.0, force_n, 0.0, 0.0, 0.0, -1);
}

static void handler(int signal)
{
    (void)signal;
    _exit(42);
}

static void command(const char *way)
{
    int calls = strcmp(way, "square") == 0 ? 4000 : 500;
    for (int call = 0; call < calls; call++) {
        double side = call % 2 ? 40.0 : -40.0;
        if (strcmp(way, "huge") == 0)
            set(1e308, -1e308, 1e308, 1e308, 1e308, -1e308, -1);
        else if (strcmp(way, "nan") == 0)
            set(NAN, NAN, NAN, 0.0, 0.0, 0.0, -1);
        else
            set(side, 0.0, side, 0.0, 0.0, 0.0, -1);
    }
}

int main(int argc, char **argv)
{
    const char *way = argc > 1 ? argv[1] : "";
    library = dlopen("libdhd.so.3", RTLD_NOW);
    if (library == NULL || find(&open_device, "dhdOpen") || find(&close_device, "dhdClose")
        || find(&set, "dhdSetForceAndTorque") || open_device() < 0)
        return 3;
    push(2.0, 100);
    if (strcmp(way, "descriptors") == 0) {
        push(6.0, 400);
        for (int file = 3; file < 1024; file++)
            close(file);
    } else if (strcmp(way, "pipes") == 0) {
        int pipe_[2];
        push(6.0, 400);
        if (pipe(pipe_) < 0)
            return 3;
        for (int file = 5; file < 200; file++)
            dup2(pipe_[1], file);
    } else if (strcmp(way, "room") == 0) {
        struct rlimit room = {200000, 200000};
        signal(SIGXFSZ, SIG_IGN);
        setrlimit(RLIMIT_FSIZE, &room);
    } else if (strcmp(way, "files") == 0) {
        struct rlimit none = {1, 1};
        setrlimit(RLIMIT_NOFILE, &none);
    } else if (strcmp(way, "folder") == 0) {
        if (chdir("/") < 0)
            return 3;
    } else if (strcmp(way, "unload") == 0) {
        dlclose(library);
        usleep(300000);
    } else if (strcmp(way, "reopen") == 0) {
        for (int time = 0; time < 20; time++) {
            close_device(-1);
            if (open_device() < 0)
                return 3;
            push(4.0, 20);
        }
    } else if (strcmp(way, "exec") == 0) {
        push(6.0, 400);
        execlp("sleep", "sleep", "0.2", (char *)0);
    } else if (strcmp(way, "leave") == 0) {
        push(6.0, 600);
        _exit(7);
    } else if (strcmp(way, "quick") == 0) {
        push(6.0, 600);
        quick_exit(7);
    } else if (strcmp(way, "signal") == 0) {
        push(6.0, 400);
        signal(SIGINT, handler);
        raise(SIGINT);
    } else if (strcmp(way, "return") == 0) {
        push(6.0, 400);
        return 5;
    } else {
        command(way);
        return close_device(-1) < 0;
    }
    push(6.0, 400);
    return close_device(-1) < 0;
}
