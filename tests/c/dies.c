/* A force model in C that ends the process, or takes signals away from the host, as the environment variable FIXTURE_DEATH
 * says: until tick 400 of a run it is an honest spring to home. Where it loops, it makes the file FIXTURE_MARK before. */
#define _GNU_SOURCE
#include "fixture.h"
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <unistd.h>

static const double stiffness_n_per_m = 200.0;
static const uint64_t at_tick = 400;
static volatile int zero = 0;
static char death[64] = "none";

static bool is_death(const char *name) {
    return strcmp(death, name) == 0;
}

static void ignore(int number) {
    (void)number;
}

static void take_signals(void) {
    for (int number = 1; number < 32; number++) {
        signal(number, ignore);
    }
}

static void loop(void) {
    const char *mark = getenv("FIXTURE_MARK");
    FILE *file = mark == NULL ? NULL : fopen(mark, "w");
    if (file != NULL) {
        fclose(file);
    }
    while (zero == 0) {
    }
}

static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)values, (void)count, (void)message;
    const char *named = getenv("FIXTURE_DEATH");
    snprintf(death, sizeof death, "%s", named == NULL ? "none" : named);
    if (is_death("handlers-in-create")) {
        take_signals();
    }
    if (is_death("blocks-in-create")) {
        sigset_t all;
        sigfillset(&all);
        pthread_sigmask(SIG_BLOCK, &all, NULL);
    }
    if (is_death("loop-in-create")) {
        take_signals();
        loop();
    }
    static int instance;
    *out = &instance;
    return 0;
}

static void destroy(FlotorInstance instance) {
    (void)instance;
}

static int overflow(int depth) {
    volatile char frame[4096];
    frame[0] = (char)depth;
    return zero == 0 ? overflow(depth + 1) + frame[0] : 0;
}

static void *leave(void *argument) {
    (void)argument;
    exit(0);
}

static void bus_error(void) {
    /* A page of a file that has none. */
    FILE *file = tmpfile();
    volatile char *page = mmap(NULL, 4096, PROT_READ, MAP_SHARED, fileno(file), 0);
    zero = page[0];
}

static void die(void) {
    if (is_death("segv")) {
        *(volatile int *)(uintptr_t)zero = 1;
    } else if (is_death("overflow")) {
        zero = overflow(0);
    } else if (is_death("bus")) {
        bus_error();
    } else if (is_death("fpe")) {
#if defined(__x86_64__)
        zero = 1000 / zero;
#else
        raise(SIGFPE); /* a division by zero is no fault there */
#endif
    } else if (is_death("ill")) {
#if defined(__x86_64__)
        __asm__ volatile("ud2");
#else
        raise(SIGILL);
#endif
    } else if (is_death("abort")) {
        abort();
    } else if (is_death("xcpu")) {
        raise(SIGXCPU);
    } else if (is_death("usr2")) {
        kill(getpid(), SIGUSR2);
        loop();
    } else if (is_death("alrm")) {
        struct itimerval soon = {.it_value = {.tv_usec = 1000}};
        setitimer(ITIMER_REAL, &soon, NULL);
        loop();
    } else if (is_death("pthread-exit")) {
        pthread_exit(NULL);
    } else if (is_death("exit")) {
        exit(0);
    } else if (is_death("thread-exit")) {
        pthread_t thread;
        pthread_create(&thread, NULL, leave, NULL);
        loop();
    } else if (is_death("_exit")) {
        _exit(0);
    } else if (is_death("exec")) {
        execl("/bin/true", "true", (char *)NULL);
    } else if (is_death("kill")) {
        kill(getpid(), SIGKILL);
    } else if (is_death("handlers-in-step")) {
        take_signals();
    } else if (is_death("loop-in-step")) {
        loop();
    }
}

static uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    (void)instance;
    memset(output, 0, sizeof *output);
    output->energy_j = NAN;
    for (int axis = 0; axis < 7; axis++) {
        double number = axis < 3 ? input->pose.position_m[axis] : input->pose.orientation_xyzw[axis - 3];
        if (!isfinite(number)) {
            output->status = FlotorStepStatus_InvalidInput;
            return FlotorCallStatus_Ok;
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        output->wrench.force_n[axis] = -stiffness_n_per_m * fmax(fmin(input->pose.position_m[axis], 0.1), -0.1);
    }
    if (input->tick >= at_tick) {
        die();
    }
    return FlotorCallStatus_Ok;
}

MODEL(dies, "fixture-c-dies", "Dies", "A spring that ends the process", FlotorMemory_Stateless,
      .create = create, .destroy = destroy, .step = step);
