/* A force model in C: honey, which slows the handle down. All a plugin needs is the header. */
#include "flotor.h"
#include <math.h>
#include <string.h>

FLOTOR_METADATA("kind = \"model\"\nid = \"honey\"\nname = \"Honey\"\ndoc = \"Slows the handle down\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_honey\"\n");

static const double DAMPING_NS_PER_M = 2.0;
static const double FASTEST_M_PER_S = 10.0; /* limits the force at any speed */

/* All instances are equal: an instance has no state, so the address of a constant serves as its handle. */
static const char instance;

static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)values, (void)count, (void)message;
    *out = (FlotorInstance)(uintptr_t)&instance;
    return 0;
}

static void destroy(FlotorInstance honey) {
    (void)honey;
}

/* In the loop, a thousand times a second: no allocation, no lock, no printing; every input gets an answer. */
static uint32_t step(FlotorInstance honey, const FlotorInput *input, FlotorOutput *output) {
    (void)honey;
    memset(output, 0, sizeof *output);
    output->energy_j = NAN; /* honey stores none */
    for (int axis = 0; axis < 3; axis++) {
        double speed_m_per_s = input->twist.linear_m_per_s[axis];
        if (!isfinite(speed_m_per_s) || !isfinite(input->pose.position_m[axis])) {
            memset(&output->wrench, 0, sizeof output->wrench);
            output->status = FlotorStepStatus_InvalidInput;
            break;
        }
        speed_m_per_s = fmin(fmax(speed_m_per_s, -FASTEST_M_PER_S), FASTEST_M_PER_S);
        output->wrench.force_n[axis] = -DAMPING_NS_PER_M * speed_m_per_s;
    }
    return FlotorCallStatus_Ok;
}

static const FlotorForceTable table = {
    .size = sizeof(FlotorForceTable),
    .info = {.id = FLOTOR_STR("honey"), .name = FLOTOR_STR("Honey"), .doc = FLOTOR_STR("Slows the handle down"),
             .serves = {FLOTOR_DEMAND_FORCE | FLOTOR_DEMAND_TORQUE}, .memory = FlotorMemory_Stateless},
    .create = create,
    .destroy = destroy,
    .step = step,
};

static const void *get_interface(FlotorStr id) {
    static const char force[] = FLOTOR_INTERFACE_FORCE;
    return id.len == sizeof force - 1 && memcmp(id.ptr, force, id.len) == 0 ? &table : NULL;
}

FLOTOR_ENTRY(flotor_entry_honey) = {
    FLOTOR_ENTRY_HEAD(FlotorPluginKind_Model), NULL, get_interface, NULL,
};
