/* Your name: a floor at home height that pushes the hand up. Change `step`, build, and feel the difference.
 *
 * A step gets where the handle is (m, z up, home at the origin) and answers with the force on the hand (N).
 *
 * Build it here: BUILD_COMMAND */
#include "flotor.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ID "your-name"
#define NAME "Your name"
#define DOC "A floor that pushes the hand up"

/* Read without running the plugin: `flotor plugins` and scenes find it by this. */
FLOTOR_METADATA("kind = \"model\"\nid = \"" ID "\"\nname = \"" NAME "\"\ndoc = \"" DOC "\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_your_name\"\n");

/* Deeper than this the floor pushes no harder, m: no pose may give a force without end. */
static const double DEEPEST_M = 0.1;

/* What one instance knows between two steps. */
typedef struct {
    double stiffness_n_per_m;
} YourName;

static const FlotorParameter parameters[] = {
    {.id = FLOTOR_STR("stiffness_n_per_m"), .unit = FLOTOR_STR("N/m"), .doc = FLOTOR_STR("Stiffness of the floor"),
     .kind = FlotorParameterKind_Real, .min = 0.0, .max = 5000.0, .default_ = 500.0},
};

/* Before the loop: the place to allocate and to read files. Only values set explicitly come in, already checked. */
static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)message; /* the place for a reason, if this refuses */
    YourName *model = malloc(sizeof *model);
    if (model == NULL) {
        return FlotorRefusalKind_Resource;
    }
    model->stiffness_n_per_m = count > 0 ? values[count - 1].number : parameters[0].default_;
    *out = model;
    return 0;
}

static void destroy(FlotorInstance instance) {
    free(instance);
}

static int is_finite(const FlotorPose *pose) {
    double sum = 0.0; /* zero times anything finite; NaN for all else */
    for (int axis = 0; axis < 3; axis++) {
        sum += 0.0 * pose->position_m[axis];
    }
    for (int axis = 0; axis < 4; axis++) {
        sum += 0.0 * pose->orientation_xyzw[axis];
    }
    return sum == 0.0;
}

/* In the loop, a thousand times a second: no allocation, no lock, no printing; every pose gets an answer. */
static uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    const YourName *model = instance;
    memset(output, 0, sizeof *output);
    output->energy_j = NAN; /* this model tells none */
    if (!is_finite(&input->pose)) {
        output->status = FlotorStepStatus_InvalidInput;
        return FlotorCallStatus_Ok;
    }
    double depth_m = fmin(fmax(-input->pose.position_m[2], 0.0), DEEPEST_M);
    output->wrench.force_n[2] = model->stiffness_n_per_m * depth_m;
    return FlotorCallStatus_Ok;
}

static double parameter(FlotorInstance instance, uint32_t index) {
    const YourName *model = instance;
    (void)index; /* the only one there is */
    return model->stiffness_n_per_m;
}

static const FlotorForceTable table = {
    .size = sizeof(FlotorForceTable),
    .parameter_count = sizeof parameters / sizeof *parameters,
    .parameters = parameters,
    .info = {.id = FLOTOR_STR(ID), .name = FLOTOR_STR(NAME), .doc = FLOTOR_STR(DOC),
             .serves = {FLOTOR_DEMAND_FORCE | FLOTOR_DEMAND_TORQUE}, .memory = FlotorMemory_Stateless},
    .create = create,
    .destroy = destroy,
    .step = step,
    .parameter = parameter,
};

static const void *get_interface(FlotorStr id) {
    static const char force[] = FLOTOR_INTERFACE_FORCE;
    return id.len == sizeof force - 1 && memcmp(id.ptr, force, id.len) == 0 ? &table : NULL;
}

FLOTOR_ENTRY(flotor_entry_your_name) = {
    FLOTOR_ENTRY_HEAD(FlotorPluginKind_Model),
    .get_interface = get_interface,
};
