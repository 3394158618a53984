/* Interface of a typical maker's library: a handle, functions that return 0 or an error, and a thread of the library. knobkit.c
 * simulates a knob in place of a real library, so that the example runs. */
#ifndef KNOBKIT_H
#define KNOBKIT_H

#ifdef __cplusplus
extern "C" {
#endif

typedef struct KkDevice KkDevice;

int kk_open(KkDevice **device);                        /* waits until the hardware answers */
int kk_enable(KkDevice *device, int on);               /* motors on or off */
int kk_get_position_mm(KkDevice *device, double *mm);  /* newest position, without waiting */
int kk_set_force_n(KkDevice *device, double n);        /* without waiting */
const char *kk_last_error(void);
void kk_close(KkDevice *device);

#ifdef __cplusplus
}
#endif
#endif
