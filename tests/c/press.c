/* A model that presses along one axis after the other: x, y, z, then about them. It begins after 400 steps; each axis is pressed
 * for 300 and free for 300. */
#ifndef PRESS_N
#define PRESS_N 1.0
#endif
#include "fixture.h"
#include <stdlib.h>

enum { BEGIN = 400, PRESSED = 300, ROUND = 600 };

static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)values, (void)count, (void)message;
    *out = calloc(1, sizeof(uint64_t));
    return 0;
}

static void destroy(FlotorInstance instance) { free(instance); }

static uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    (void)input;
    uint64_t *steps = instance;
    const uint64_t at = (*steps)++;
    *output = (FlotorOutput){0};
    if (at >= BEGIN && (at - BEGIN) / ROUND < 6 && (at - BEGIN) % ROUND < PRESSED) {
        const uint64_t axis = (at - BEGIN) / ROUND;
        if (axis < 3) {
            output->wrench.force_n[axis] = PRESS_N;
        } else {
            output->wrench.torque_nm[axis - 3] = 0.02 * PRESS_N;
        }
    }
    return FlotorCallStatus_Ok;
}

MODEL(press, "fixture-press", "Press", "Presses along each axis", FlotorMemory_PathDependent,
      .create = create, .destroy = destroy, .step = step);
