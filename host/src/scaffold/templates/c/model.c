/* Your name: a floor at home height that pushes the hand up. Change `step`, build, and feel the difference.
 *
 * A step gets where the handle is (m, z up, home at the origin) and answers with the force on the hand (N).
 *
 * Build it here: BUILD_COMMAND */
#include "flotor.h"
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define ID "your-name"
#define NAME "Your name"
#define DOC "A floor that pushes the hand up"

/* Read without running the plugin: `flotor plugins` and scenes find it by this. */
FLOTOR_METADATA("kind = \"model\"\nid = \"" ID "\"\nname = \"" NAME "\"\ndoc = \"" DOC "\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_your_name\"\n");

/* One instance of the model. */
typedef struct {
    double values[3]; /* of the parameters, in their order */
    FlotorPrimitive bodies[2];
} YourName;

enum { STIFFNESS, HEIGHT, THICKNESS };

/* `live`: may change during a run. */
static const FlotorParameter parameters[] = {
    [STIFFNESS] = {.id = FLOTOR_STR("stiffness_n_per_m"), .unit = FLOTOR_STR("N/m"),
                   .doc = FLOTOR_STR("Stiffness of the floor"), .kind = FlotorParameterKind_Real,
                   .mutability = FlotorMutability_Live, .min = 0.0, .max = 5000.0, .default_ = 500.0},
    [HEIGHT] = {.id = FLOTOR_STR("height_mm"), .unit = FLOTOR_STR("mm"), .doc = FLOTOR_STR("Height of the floor"),
                .kind = FlotorParameterKind_Real, .mutability = FlotorMutability_Live, .min = -10.0, .max = 10.0,
                .default_ = 0.0},
    [THICKNESS] = {.id = FLOTOR_STR("thickness_mm"), .unit = FLOTOR_STR("mm"),
                   .doc = FLOTOR_STR("Depth at the largest force"), .kind = FlotorParameterKind_Real,
                   .mutability = FlotorMutability_Live, .min = 1.0, .max = 100.0, .default_ = 50.0},
};

/* Before the loop: the place to allocate and to read files. Only values set explicitly come in, already checked. */
static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)message; /* the place for a reason, if this refuses */
    YourName *model = malloc(sizeof *model);
    if (model == NULL) {
        return FlotorRefusalKind_Resource;
    }
    for (uint32_t index = STIFFNESS; index <= THICKNESS; index++) {
        model->values[index] = parameters[index].default_;
    }
    for (uint32_t set = 0; set < count; set++) {
        model->values[values[set].index] = values[set].number;
    }
    *out = model;
    return 0;
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

/* In the loop, a thousand times a second: no allocation, no lock, no printing; every pose gets an answer. */
static uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    const double *values = ((const YourName *)instance)->values;
    memset(output, 0, sizeof *output);
    output->energy_j = NAN; /* unknown */
    if (!is_finite(&input->pose)) {
        output->status = FlotorStepStatus_InvalidInput;
        return FlotorCallStatus_Ok;
    }
    double depth_m = fmin(fmax(1e-3 * values[HEIGHT] - input->pose.position_m[2], 0.0), 1e-3 * values[THICKNESS]);
    output->wrench.force_n[2] = values[STIFFNESS] * depth_m;
    return FlotorCallStatus_Ok;
}

/* Between two steps: the new value of a live parameter. A value that the model cannot use is refused, and the old
 * one stays. */
static uint32_t set_parameter(FlotorInstance instance, uint32_t index, double value) {
    if (!(value >= parameters[index].min && value <= parameters[index].max)) {
        return FlotorCallStatus_OutOfRange;
    }
    ((YourName *)instance)->values[index] = value;
    return FlotorCallStatus_Ok;
}

static double parameter(FlotorInstance instance, uint32_t index) {
    return ((const YourName *)instance)->values[index];
}

/* Appearance in the viewer: the floor, and the ball in the hand. */
static uint32_t shape(FlotorInstance instance, const FlotorInput *input, FlotorShapeView *out) {
    YourName *model = instance;
    model->bodies[0] = (FlotorPrimitive){
        .form = FlotorForm_Plane, .part = FlotorPart_Body,
        .pose = {.position_m = {0.0, 0.0, 1e-3 * model->values[HEIGHT]}, .orientation_xyzw = {0.0, 0.0, 0.0, 1.0}},
        .half_sides_m = {0.02, 0.02, 0.0},
    };
    model->bodies[1] = (FlotorPrimitive){
        .form = FlotorForm_Sphere, .part = FlotorPart_Tool, .pose = input->pose, .half_sides_m = {0.001, 0.001, 0.001},
    };
    memset(out, 0, sizeof *out);
    out->primitives = model->bodies;
    out->primitive_count = 2;
    return FlotorCallStatus_Ok;
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
    .set_parameter = set_parameter,
    .parameter = parameter,
};

static const FlotorShapeTable shape_table = {.size = sizeof(FlotorShapeTable), .shape = shape};

static bool is(FlotorStr id, const char *name) {
    return id.len == strlen(name) && memcmp(id.ptr, name, id.len) == 0;
}

static const void *get_interface(FlotorStr id) {
    if (is(id, FLOTOR_INTERFACE_FORCE)) {
        return &table;
    }
    return is(id, FLOTOR_INTERFACE_SHAPE) ? &shape_table : NULL;
}

FLOTOR_ENTRY(flotor_entry_your_name) = {
    FLOTOR_ENTRY_HEAD(FlotorPluginKind_Model),
    .get_interface = get_interface,
};
