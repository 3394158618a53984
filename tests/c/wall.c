/* A force model in C: a wall that pushes the hand up where it is below home. All a plugin needs is the header.
 *
 * WITHOUT_STEP, WITHOUT_TABLE, SHORT_TABLE, MISALIGNED_TABLE, SHORT_EXTENSION, WITHOUT_LAYOUTS, OTHER_CANDIDATE, OTHER_KIND, ODD_KIND,
 * SHORT_ENTRY, HIDDEN_ENTRY and ODD_ANSWERS make the mistakes a C author can make; the tests expect each to be
 * refused. CRASHES follows a null pointer from tick 50 on. */
#include "flotor.h"
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

FLOTOR_METADATA("kind = \"model\"\nid = \"fixture-c-wall\"\nname = \"Wall\"\ndoc = \"A flat wall, in C\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_wall\"\n");

typedef struct {
    double stiffness_n_per_m;
} Wall;

static const FlotorParameter parameters[] = {
    {.id = FLOTOR_STR("stiffness_n_per_m"), .unit = FLOTOR_STR("N/m"), .doc = FLOTOR_STR("Stiffness of the wall"),
     .kind = FlotorParameterKind_Real, .min = 0.0, .max = 5000.0, .default_ = 500.0},
};

/* The host has checked the values against the schema: only what was set explicitly is among them. */
static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    Wall *wall = malloc(sizeof *wall);
    if (wall == NULL) {
        static const char reason[] = "no memory for a wall";
        memcpy(message->text, reason, sizeof reason - 1);
        message->len = sizeof reason - 1;
        return FlotorRefusalKind_Resource;
    }
    wall->stiffness_n_per_m = count > 0 ? values[count - 1].number : parameters[0].default_;
    *out = wall;
    return 0;
}

static void destroy(FlotorInstance instance) {
    free(instance);
}

#ifndef WITHOUT_STEP
static uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    const Wall *wall = instance;
    const FlotorPose *pose = &input->pose;
    memset(output, 0, sizeof *output);
    output->energy_j = NAN;
    for (int axis = 0; axis < 7; axis++) {
        double number = axis < 3 ? pose->position_m[axis] : pose->orientation_xyzw[axis - 3];
        if (!isfinite(number)) {
            output->status = FlotorStepStatus_InvalidInput;
            return FlotorCallStatus_Ok;
        }
    }
#ifdef CRASHES
    if (input->tick >= 50) {
        *(volatile int *)NULL = 1;
    }
#endif
    double depth_m = fmax(-pose->position_m[2], 0.0);
    output->wrench.force_n[2] = wall->stiffness_n_per_m * fmin(depth_m, 1.0);
#ifdef ODD_ANSWERS
    output->status = 99; /* no status of the contract */
#endif
    return FlotorCallStatus_Ok;
}
#endif

static const FlotorForceTable table = {
#ifdef SHORT_TABLE
    .size = offsetof(FlotorForceTable, last_message),
#else
    .size = sizeof(FlotorForceTable),
#endif
    .parameter_count = 1,
    .parameters = parameters,
    .info = {.id = FLOTOR_STR("fixture-c-wall"), .name = FLOTOR_STR("Wall"), .doc = FLOTOR_STR("A flat wall, in C"),
             .serves = {FLOTOR_DEMAND_FORCE | FLOTOR_DEMAND_TORQUE}, .memory = FlotorMemory_Stateless},
    .create = create,
    .destroy = destroy,
#ifndef WITHOUT_STEP
    .step = step,
#endif
};

#ifdef SHORT_EXTENSION
static const FlotorActiveRegionTable activity = {.size = offsetof(FlotorActiveRegionTable, region)};
#endif

static int is(FlotorStr id, const char *name) {
    return id.len == strlen(name) && memcmp(id.ptr, name, id.len) == 0;
}

static const void *get_interface(FlotorStr id) {
#ifdef WITHOUT_TABLE
    id.len = 0;
#endif
#ifdef SHORT_EXTENSION
    if (is(id, FLOTOR_INTERFACE_ACTIVE_REGION)) {
        return &activity;
    }
#endif
    if (!is(id, FLOTOR_INTERFACE_FORCE)) {
        return NULL;
    }
#ifdef MISALIGNED_TABLE
    return (const char *)&table + 4;
#else
    return &table;
#endif
}

#ifdef HIDDEN_ENTRY
__attribute__((visibility("hidden"))) extern const FlotorEntry flotor_entry_wall;
#else
FLOTOR_EXPORT extern const FlotorEntry flotor_entry_wall;
#endif
const FlotorEntry flotor_entry_wall = {
    .magic = FLOTOR_MAGIC_BYTES,
#ifdef SHORT_ENTRY
    .size = offsetof(FlotorEntry, layout_proof),
#else
    .size = sizeof(FlotorEntry),
#endif
    .abi_major = FLOTOR_ABI_MAJOR,
    .abi_minor = FLOTOR_ABI_MINOR,
#if defined(OTHER_KIND)
    .kind = FlotorPluginKind_Device,
#elif defined(ODD_KIND)
    .kind = 7, /* no kind of the contract */
#else
    .kind = FlotorPluginKind_Model,
#endif
#ifdef OTHER_CANDIDATE
    .abi_candidate = 0, /* the 1.0 that was frozen before its candidate */
#else
    .abi_candidate = FLOTOR_ABI_CANDIDATE,
#endif
#ifndef WITHOUT_LAYOUTS
    .layouts = flotor_layouts,
    .layout_count = FLOTOR_LAYOUT_COUNT,
#endif
    .get_interface = get_interface,
};
