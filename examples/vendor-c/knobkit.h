/* The interface of a maker's library, as makers write them: a handle, calls that return 0 or an error, and a thread of the library's
 * own behind them. This one stands in for a real one, so that the example runs: knobkit.c has a knob in numbers only. */
#ifndef KNOBKIT_H
#define KNOBKIT_H

#ifdef __cplusplus
extern "C" {
#endif

typedef struct KkDevice KkDevice;

int kk_open(KkDevice **device);                        /* waits until the hardware answers */
int kk_enable(KkDevice *device, int on);               /* motors on or off */
int kk_get_position_mm(KkDevice *device, double *mm);  /* the newest, without waiting */
int kk_set_force_n(KkDevice *device, double n);        /* without waiting */
const char *kk_last_error(void);
void kk_close(KkDevice *device);

#ifdef __cplusplus
}
#endif
#endif
