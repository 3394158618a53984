/* A spring to home with one of the faults of a force model. */
#include "planted.h"

DESCRIPTION("model", planted_model, "fixture-planted-model", "Planted model", "A spring with a fault");

#define FAULTS(X)                                                                                                         \
    X(none) X(loop_step) X(loop_create) X(loop_destroy) X(loop_prepare) X(loop_param) X(segv) X(stack) X(abort) X(exit0)  \
    X(exit3) X(thread_exit0) X(_exit0) X(late_writer) X(freed_text) X(sleep900) X(sleep5) X(alloc1g) X(closefds)          \
    X(sighandlers) X(sigblock) X(ftz) X(rounding) X(fork) X(fork_step) X(change_table) X(kill_term) X(kill_int3)          \
    X(sigstop) X(pthread_exit) X(fpe_trap) X(heap) X(overrun_out) X(setitimer) X(chdir) X(stdout) X(affinity) X(rlimit)   \
    X(spawn100) X(big_stack) X(nice_idle) X(longmsg) X(refuse_nomsg) X(refuse_badutf) X(null_out) X(energy_nan)           \
    X(neg_status) X(destroy_segv) X(destroy_exit) X(atexit_loop) X(dtor_segv) X(exec) X(ptrace) X(double_answer)          \
    X(null_deref_thread) X(free_host) X(write_host_stack) X(munmap_self) X(env)                                           \
    X(heap_read) X(use_after_free) X(write_input) X(umask) X(late_alloc) X(thread_prepare) X(crash_reach)                 \
    X(crash_activity) X(crash_field) X(crash_centerline) X(crash_details) X(field_nan) X(sigaltered_step)                 \
    X(thread_destroy) X(timer) X(crash_shape) X(shape_corner) X(crash_contacts) X(contacts_gap)

PLANTED_SCHEMA

typedef struct {
    int fault;
    uint64_t steps;
    char *block;
} Spring;

/* Of the library, not of an instance: what is left when that is gone. */
static bool crashes_at_the_end;
static FlotorOutput *volatile lent;

__attribute__((destructor)) static void at_the_end(void) {
    if (crashes_at_the_end) {
        crash();
    }
}

static void *exits(void *argument) {
    sleep_us(2000);
    exit(0);
    return argument;
}

static void *writes(void *argument) {
    for (;;) {
        sleep_us(1000);
        if (lent != NULL) {
            lent->wrench.force_n[2] = 1.0e6;
        }
    }
    return argument;
}

static void *crashes(void *argument) {
    sleep_us(300000);
    crash();
    return argument;
}

static void *spins(void *argument) {
    loop_for_ever();
    return argument;
}

static void *naps(void *argument) {
    sleep_us(60000000);
    return argument;
}

static void start(void *(*body)(void *)) {
    pthread_t thread;
    if (pthread_create(&thread, NULL, body, NULL) == 0) {
        pthread_detach(thread);
    }
}

static void caught(int number) {
    (void)number;
}

static void flush_to_zero(void) {
#if defined(__x86_64__)
    __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040);
#elif defined(__aarch64__)
    uint64_t mode;
    __asm__ volatile("mrs %0, fpcr" : "=r"(mode));
    __asm__ volatile("msr fpcr, %0" : : "r"(mode | (1ULL << 24)));
#endif
}

static int recurse(volatile int depth) {
    volatile char room[4096];
    room[depth % 4096] = (char)depth;
    return forever ? recurse(depth + 1) + room[0] : 0;
}

static int deep(volatile int unused) {
    volatile char room[7 * 1024 * 1024];
    for (size_t at = 0; at < sizeof room; at += 4096) {
        room[at] = (char)unused;
    }
    return room[0];
}

static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    int fault = chosen(values, count);
    Spring *spring = calloc(1, sizeof *spring);
    if (spring == NULL) {
        return FlotorRefusalKind_Resource;
    }
    spring->fault = fault;
    spring->block = malloc(64);
    switch (fault) {
    case FAULT_loop_create: loop_for_ever(); break;
    case FAULT_thread_exit0: start(exits); break;
    case FAULT_late_writer: start(writes); break;
    case FAULT_null_deref_thread: start(crashes); break;
    case FAULT_spawn100:
        for (int number = 0; number < 100; number++) {
            start(spins);
        }
        break;
    case FAULT_sighandlers:
        for (int number = 1; number < 32; number++) {
            signal(number, caught);
        }
        break;
    case FAULT_sigblock: {
        sigset_t all;
        sigfillset(&all);
        pthread_sigmask(SIG_BLOCK, &all, NULL);
        break;
    }
    case FAULT_fork:
        if (fork() == 0) {
            sleep_us(200000);
            _exit(0);
        }
        break;
    case FAULT_chdir: count = (uint32_t)chdir("/"); break;
    case FAULT_umask: umask(0); break;
    case FAULT_closefds:
        for (int number = 0; number <= 50; number++) {
            close(number);
        }
        break;
    case FAULT_affinity: {
        cpu_set_t all, one;
        sched_getaffinity(0, sizeof all, &all);
        CPU_ZERO(&one);
        for (int number = 0; number < CPU_SETSIZE && CPU_COUNT(&one) == 0; number++) {
            if (CPU_ISSET(number, &all)) {
                CPU_SET(number, &one);
            }
        }
        sched_setaffinity(0, sizeof one, &one);
        break;
    }
    case FAULT_rlimit: setrlimit(RLIMIT_FSIZE, &(struct rlimit){0, RLIM_INFINITY}); break;
    case FAULT_nice_idle: sched_setscheduler(0, SCHED_IDLE, &(struct sched_param){0}); break;
    case FAULT_setitimer: setitimer(ITIMER_REAL, &(struct itimerval){{0, 20000}, {0, 20000}}, NULL); break;
    case FAULT_timer: {
        timer_t timer;
        struct sigevent event = {.sigev_notify = SIGEV_SIGNAL, .sigev_signo = SIGUSR2};
        if (timer_create(CLOCK_MONOTONIC, &event, &timer) == 0) {
            timer_settime(timer, 0, &(struct itimerspec){.it_value = {3600, 0}}, NULL);
        }
        break;
    }
    case FAULT_ptrace: ptrace(PTRACE_TRACEME, 0, NULL, NULL); break;
    case FAULT_env: setenv("PLANTED", "1", 1); break;
    case FAULT_atexit_loop: atexit(loop_for_ever); break;
    case FAULT_dtor_segv: crashes_at_the_end = true; break;
    case FAULT_refuse_nomsg: return FlotorRefusalKind_Resource;
    case FAULT_refuse_badutf:
        memcpy(message->text, "\xff\x1b[2Jno", 7);
        message->len = 7;
        return FlotorRefusalKind_Resource;
    case FAULT_null_out: *out = NULL; return 0;
    case FAULT_kill_term: kill(getpid(), SIGTERM); break;
    case FAULT_kill_int3:
        for (int number = 0; number < 3; number++) {
            kill(getpid(), SIGINT);
        }
        break;
    default: break;
    }
    *out = spring;
    return 0;
}

static void destroy(FlotorInstance instance) {
    Spring *spring = instance;
    switch (spring->fault) {
    case FAULT_loop_destroy: loop_for_ever(); break;
    case FAULT_destroy_segv: crash(); break;
    case FAULT_destroy_exit: exit(0);
    case FAULT_thread_destroy: start(naps); break;
    default: break;
    }
    free(spring->block);
    free(spring);
}

static uint32_t prepare(FlotorInstance instance, const FlotorLoopConfig *config, FlotorMessage *message) {
    (void)config, (void)message;
    const Spring *spring = instance;
    if (spring->fault == FAULT_loop_prepare) {
        loop_for_ever();
    }
    if (spring->fault == FAULT_thread_prepare) {
        start(naps);
    }
    return 0;
}

static FlotorForceTable table;

/* What goes wrong in a step. */
static uint32_t go_wrong(Spring *spring, const FlotorInput *input, FlotorOutput *output) {
    switch (spring->fault) {
    case FAULT_loop_step: loop_for_ever(); break;
    case FAULT_segv: crash(); break;
    case FAULT_stack: output->reserved = (uint32_t)recurse(0) & 0; break;
    case FAULT_abort: abort();
    case FAULT_exit0: exit(0);
    case FAULT_exit3: exit(3);
    case FAULT__exit0: _exit(0);
    case FAULT_exec: execl("/bin/true", "true", (char *)NULL); break;
    case FAULT_late_writer: lent = output; break;
    case FAULT_sleep900: sleep_us(900); break;
    case FAULT_sleep5: sleep_us(5000); break;
    case FAULT_alloc1g: {
        char *volatile much = malloc(1 << 30);
        if (much != NULL) {
            much[0] = 1;
        }
        break;
    }
    case FAULT_late_alloc:
        if (spring->steps == 2) {
            char *volatile once = malloc(100000);
            free(once);
        }
        break;
    case FAULT_ftz: flush_to_zero(); break;
    case FAULT_rounding: fesetround(FE_UPWARD); break;
    case FAULT_fpe_trap: feenableexcept(FE_DIVBYZERO | FE_INVALID); break;
    case FAULT_fork_step:
        if (spring->steps == 2 && fork() == 0) {
            _exit(0);
        }
        break;
    case FAULT_change_table: table.set_parameter = NULL; break;
    case FAULT_sigstop: kill(getpid(), SIGSTOP); break;
    case FAULT_pthread_exit: pthread_exit(NULL);
    case FAULT_heap: ((volatile char *)spring->block)[64] = 1; break;
    case FAULT_heap_read: output->reserved = ((volatile unsigned char *)spring->block)[64] & 0U; break;
    case FAULT_use_after_free: {
        char *block = malloc(64);
        volatile uintptr_t gone = (uintptr_t)block; /* or the compiler sees it */
        free(block);
        output->reserved = *(volatile unsigned char *)gone & 0U;
        break;
    }
    case FAULT_overrun_out: memset((void *)((volatile char *)output + sizeof *output), 1, 8); break;
    case FAULT_write_input: ((FlotorInput *)(uintptr_t)input)->pose.position_m[0] = 1.0; break;
    case FAULT_stdout: puts("a model that says something"), fflush(stdout); break;
    case FAULT_big_stack: output->reserved = (uint32_t)deep(0) & 0U; break;
    case FAULT_energy_nan: output->energy_j = -INFINITY; break;
    case FAULT_neg_status: output->status = (uint32_t)-1; break;
    case FAULT_double_answer: return 77;
    case FAULT_free_host: free((void *)(uintptr_t)output); break;
    case FAULT_write_host_stack: {
        volatile char here = 0;
        for (size_t at = 0; at < 65536; at++) {
            *((volatile char *)&here + at) = 0x55;
        }
        break;
    }
    case FAULT_munmap_self: munmap((void *)((uintptr_t)&go_wrong & ~4095UL), 4096); break;
    case FAULT_sigaltered_step: signal(SIGINT, SIG_IGN); break;
    default: break;
    }
    return FlotorCallStatus_Ok;
}

static uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    Spring *spring = instance;
    memset(output, 0, sizeof *output);
    output->energy_j = NAN;
    for (int axis = 0; axis < 7; axis++) {
        if (!isfinite(axis < 3 ? input->pose.position_m[axis] : input->pose.orientation_xyzw[axis - 3])) {
            output->status = FlotorStepStatus_InvalidInput;
            return FlotorCallStatus_Ok;
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        output->wrench.force_n[axis] = -200.0 * fmax(fmin(input->pose.position_m[axis], 0.1), -0.1);
    }
    spring->steps += 1;
    return spring->steps < 2 ? (uint32_t)FlotorCallStatus_Ok : go_wrong(spring, input, output);
}

static uint32_t set_parameter(FlotorInstance instance, uint32_t index, double value) {
    Spring *spring = instance;
    if (spring->fault == FAULT_loop_param) {
        loop_for_ever();
    }
    return index == 1 && value >= 0.0 ? (uint32_t)FlotorCallStatus_Ok : (uint32_t)FlotorCallStatus_OutOfRange;
}

static void last_message(FlotorInstance instance, FlotorMessage *message) {
    const Spring *spring = instance;
    message->len = spring->fault == FAULT_longmsg || spring->fault == FAULT_freed_text ? 4000000000U : 0;
    if (spring->fault == FAULT_freed_text) {
        memset(message->text, 0xdd, sizeof message->text);
    }
}

/* One live parameter beside the choice: so that it can be set. */
static FlotorParameter schema[2];

static FlotorForceTable table = {
    .size = sizeof(FlotorForceTable),
    .parameter_count = 2,
    .parameters = schema,
    .info = {.id = FLOTOR_STR("fixture-planted-model"), .name = FLOTOR_STR("Planted model"),
             .doc = FLOTOR_STR("A spring with a fault"),
             .serves = {FLOTOR_DEMAND_FORCE | FLOTOR_DEMAND_TORQUE}, .memory = FlotorMemory_Stateless},
    .create = create,
    .destroy = destroy,
    .prepare = prepare,
    .step = step,
    .set_parameter = set_parameter,
    .last_message = last_message,
};

static uint32_t region(FlotorInstance instance, FlotorActiveRegion *out) {
    if (((const Spring *)instance)->fault == FAULT_crash_activity) {
        crash();
    }
    *out = (FlotorActiveRegion){.shape = 0};
    return FlotorCallStatus_Ok;
}

static uint32_t bounds(FlotorInstance instance, FlotorWorkspaceBounds *out) {
    if (((const Spring *)instance)->fault == FAULT_crash_reach) {
        crash();
    }
    for (int axis = 0; axis < 3; axis++) {
        out->lower_m[axis] = -1.0;
        out->upper_m[axis] = 1.0;
    }
    return FlotorCallStatus_Ok;
}

static uint32_t linear_field(FlotorInstance instance, const FlotorInput *input, FlotorLinearField *field) {
    const Spring *spring = instance;
    if (spring->fault == FAULT_crash_field) {
        crash();
    }
    memset(field, 0, sizeof *field);
    field->anchor = input->pose;
    field->valid_m = field->valid_rad = INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        field->wrench.force_n[axis] = -200.0 * input->pose.position_m[axis];
        field->stiffness[axis][axis] = spring->fault == FAULT_field_nan ? NAN : 200.0;
    }
    return FlotorCallStatus_Ok;
}

static uint32_t contact_set(FlotorInstance instance, const FlotorInput *input, FlotorContactSet *set) {
    const Spring *spring = instance;
    if (spring->fault == FAULT_crash_contacts) {
        crash();
    }
    memset(set, 0, sizeof *set);
    set->anchor = input->pose;
    set->valid_m = set->valid_rad = INFINITY;
    set->count = 1;
    set->contacts[0].normal[2] = 1.0;
    set->contacts[0].surface_point_m[2] = -1.0;
    set->contacts[0].gap_m = input->pose.position_m[2] + (spring->fault == FAULT_contacts_gap ? 0.5 : 1.0);
    set->contacts[0].stiffness_n_per_m = 200.0;
    return FlotorCallStatus_Ok;
}

static uint32_t line_info(FlotorInstance instance, FlotorCenterlineInfo *out) {
    (void)instance;
    out->suggested_points = 2;
    return FlotorCallStatus_Ok;
}

static uint32_t line(FlotorInstance instance, const FlotorInput *input, FlotorPose *points, uint32_t capacity, uint32_t *count) {
    if (((const Spring *)instance)->fault == FAULT_crash_centerline) {
        crash();
    }
    *count = capacity > 0;
    points[0] = input->pose;
    return FlotorCallStatus_Ok;
}

static uint32_t shape(FlotorInstance instance, const FlotorInput *input, FlotorShapeView *out) {
    static FlotorSurfaceVertex corners[3] = {{.value = 1.0}, {.position_m = {1e-3}}, {.position_m = {0.0, 1e-3}}};
    static uint32_t triangle[1][3] = {{0, 1, 2}};
    (void)input;
    if (((const Spring *)instance)->fault == FAULT_crash_shape) {
        crash();
    }
    triangle[0][2] = ((const Spring *)instance)->fault == FAULT_shape_corner ? 3 : 2;
    out->vertices = corners;
    out->vertex_count = 3;
    out->triangles = (const uint32_t(*)[3])triangle;
    out->triangle_count = 1;
    return FlotorCallStatus_Ok;
}

static const FlotorDetail detail[] = {{.id = FLOTOR_STR("steps"), .doc = FLOTOR_STR("Steps so far")}};

static uint32_t detail_values(FlotorInstance instance, double *values, uint32_t capacity) {
    const Spring *spring = instance;
    if (spring->fault == FAULT_crash_details) {
        crash();
    }
    if (capacity > 0) {
        values[0] = (double)spring->steps;
    }
    return FlotorCallStatus_Ok;
}

static const void *get_interface(FlotorStr id) {
    static const FlotorActiveRegionTable regions = {.size = sizeof regions, .region = region};
    static const FlotorWorkspaceBoundsTable reaches = {.size = sizeof reaches, .bounds = bounds};
    static const FlotorLinearFieldTable fields = {.size = sizeof fields, .linear_field = linear_field};
    static const FlotorContactSetTable sets = {.size = sizeof sets, .contact_set = contact_set};
    static const FlotorCenterlineTable lines = {.size = sizeof lines, .info = line_info, .centerline = line};
    static const FlotorShapeTable shapes = {.size = sizeof shapes, .shape = shape};
    static const FlotorDetailsTable details = {
        .size = sizeof details, .detail_count = 1, .details = detail, .values = detail_values};
    const struct {
        const char *id;
        const void *table;
    } offered[] = {
        {FLOTOR_INTERFACE_FORCE, &table},
        {FLOTOR_INTERFACE_ACTIVE_REGION, &regions},
        {FLOTOR_INTERFACE_WORKSPACE_BOUNDS, &reaches},
        {FLOTOR_INTERFACE_LINEAR_FIELD, &fields},
        {FLOTOR_INTERFACE_CONTACT_SET, &sets},
        {FLOTOR_INTERFACE_CENTERLINE, &lines},
        {FLOTOR_INTERFACE_SHAPE, &shapes},
        {FLOTOR_INTERFACE_DETAILS, &details},
    };
    schema[0] = parameters[0];
    schema[1] = (FlotorParameter){.id = FLOTOR_STR("weight"), .unit = FLOTOR_STR("1"), .doc = FLOTOR_STR("Changes nothing"),
                                  .kind = FlotorParameterKind_Real, .mutability = FlotorMutability_Live, .max = 1.0};
    for (size_t at = 0; at < sizeof offered / sizeof *offered; at++) {
        if (is_called(id, offered[at].id)) {
            return offered[at].table;
        }
    }
    return NULL;
}

ENTRY(FlotorPluginKind_Model, planted_model);
