/* Your name: a soft block, too slow for the loop. Replace `solve` by your solver, build, and feel the difference.
 *
 * The loop runs a thousand times a second; `contact_set` runs at the rate that the scene gives, in a thread of its own. It
 * gets where the handle is (m, z up, home at the origin) and answers with the surface under the handle. In every tick the
 * loop computes the force of this surface, which pushes the hand and never pulls.
 *
 * Build it here: BUILD_COMMAND */
#include "flotor.h"
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define ID "your-name"
#define NAME "Your name"
#define DOC "A soft block of four layers"

/* Read without running the plugin: `flotor plugins` and scenes find it by this. */
FLOTOR_METADATA("kind = \"model\"\nid = \"" ID "\"\nname = \"" NAME "\"\ndoc = \"" DOC "\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_your_name\"\n");

/* One instance of the model: the place for the state of a solver. */
typedef struct {
    double force_n;
} YourName;

/* Height of a layer, m, and for each layer the force that halves it, N. */
static const double layer_m = 0.0075;
static const double half_n[4] = {10.0, 20.0, 40.0, 80.0};
/* Largest depth passed to the solver, m. Below, the stiffness is constant. */
static const double deepest_m = 0.012;

/* Finds force and stiffness (N/m) at a depth: a layer of height h gives way by h F / (s + F), and Newton's method finds
 * the force F that all layers have when together they give way by the depth. */
static double solve(YourName *block, double depth_m) {
    double slope = 1.0;
    block->force_n = 0.0;
    for (int round = 0; round < 50; round++) {
        double yielded_m = 0.0;
        slope = 0.0;
        for (int layer = 0; layer < 4; layer++) {
            double sum_n = half_n[layer] + block->force_n;
            yielded_m += layer_m * block->force_n / sum_n;
            slope += layer_m * half_n[layer] / (sum_n * sum_n);
        }
        block->force_n += (depth_m - yielded_m) / slope;
    }
    return 1.0 / slope;
}

/* In a thread of its own: may allocate and wait, but not longer than a period of the model. */
static uint32_t contact_set(FlotorInstance instance, const FlotorInput *input, FlotorContactSet *set) {
    YourName *block = instance;
    double height_m = input->pose.position_m[2];
    double depth_m = fmin(fmax(-height_m, 0.0), deepest_m);
    double stiffness_n_per_m = solve(block, depth_m);
    /* The plane behind which a spring of this stiffness has this force. Above the block it is the surface itself. */
    double gap_m = height_m + depth_m - block->force_n / stiffness_n_per_m;
    memset(set, 0, sizeof *set);
    set->anchor = input->pose;
    set->time_ns = input->time_ns;
    set->valid_m = 0.0005; /* within it the stiffness changes by less than a tenth */
    set->valid_rad = INFINITY;
    set->count = 1;
    set->contacts[0] = (FlotorContact){
        .surface_point_m = {input->pose.position_m[0], input->pose.position_m[1], height_m - gap_m},
        .normal = {0.0, 0.0, 1.0},
        .gap_m = gap_m,
        .stiffness_n_per_m = stiffness_n_per_m,
        .damping_ns_per_m = 6.0,
    };
    return FlotorCallStatus_Ok;
}

/* Before the loop: the place to read files. */
static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)values;
    (void)count;
    (void)message; /* the place for a reason, if this refuses */
    *out = calloc(1, sizeof(YourName));
    return *out == NULL ? FlotorRefusalKind_Resource : 0;
}

static void destroy(FlotorInstance instance) {
    free(instance);
}

static bool is_finite(const FlotorPose *pose) {
    double sum = 0.0; /* zero times anything finite; NaN for all else */
    for (int axis = 0; axis < 3; axis++) {
        sum += 0.0 * pose->position_m[axis];
    }
    for (int axis = 0; axis < 4; axis++) {
        sum += 0.0 * pose->orientation_xyzw[axis];
    }
    return sum == 0.0;
}

/* In the loop, for scenes without `[model.field]`: no force, because the solver is too slow. */
static uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    (void)instance;
    memset(output, 0, sizeof *output);
    output->energy_j = NAN; /* unknown */
    output->status = is_finite(&input->pose) ? FlotorStepStatus_OutOfDomain : FlotorStepStatus_InvalidInput;
    return FlotorCallStatus_Ok;
}

static const FlotorForceTable table = {
    .size = sizeof(FlotorForceTable),
    .info = {.id = FLOTOR_STR(ID), .name = FLOTOR_STR(NAME), .doc = FLOTOR_STR(DOC),
             .serves = {FLOTOR_DEMAND_FORCE | FLOTOR_DEMAND_TORQUE}, .memory = FlotorMemory_Stateless},
    .create = create,
    .destroy = destroy,
    .step = step,
};

static const FlotorContactSetTable contact_table = {.size = sizeof(FlotorContactSetTable), .contact_set = contact_set};

static bool is(FlotorStr id, const char *name) {
    return id.len == strlen(name) && memcmp(id.ptr, name, id.len) == 0;
}

static const void *get_interface(FlotorStr id) {
    if (is(id, FLOTOR_INTERFACE_FORCE)) {
        return &table;
    }
    return is(id, FLOTOR_INTERFACE_CONTACT_SET) ? &contact_table : NULL;
}

FLOTOR_ENTRY(flotor_entry_your_name) = {
    FLOTOR_ENTRY_HEAD(FlotorPluginKind_Model),
    .get_interface = get_interface,
};
