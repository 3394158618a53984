/* Simulated knob: it moves between -3 and 3 mm, one way in 200 calls, whatever the force. */
#include "knobkit.h"
#include <stddef.h>

struct KkDevice {
    int calls, on;
    double force_n;
};

static KkDevice the_knob;

int kk_open(KkDevice **device) {
    the_knob = (KkDevice){0};
    *device = &the_knob;
    return 0;
}

int kk_enable(KkDevice *device, int on) {
    device->on = on;
    device->force_n = 0.0;
    return 0;
}

int kk_get_position_mm(KkDevice *device, double *mm) {
    int phase = device->calls++ % 400;
    *mm = 3.0 * (phase < 200 ? phase / 100.0 - 1.0 : 3.0 - phase / 100.0);
    return device->on ? 0 : -1;
}

int kk_set_force_n(KkDevice *device, double n) {
    device->force_n = n;
    return device->on ? 0 : -1;
}

const char *kk_last_error(void) {
    return "the motors are off";
}

void kk_close(KkDevice *device) {
    device->on = 0;
}
