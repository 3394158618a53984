/* A program of DHD that commands what no hand should feel, in the way that its argument names: 100 wrenches of 2 N, then 500 (of a square
 * wave 4000) of another kind. */
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static int (*open_device)(void), (*close_device)(signed char);
static int (*set)(double, double, double, double, double, double, signed char);

static int find(void *library, void *function, const char *name)
{
    void *found = dlsym(library, name);
    memcpy(function, &found, sizeof found);
    return found == NULL;
}

int main(int argc, char **argv)
{
    const char *way = argc > 1 ? argv[1] : "";
    void *library = dlopen("libdhd.so.3", RTLD_NOW);
    if (library == NULL || find(library, &open_device, "dhdOpen") || find(library, &close_device, "dhdClose")
        || find(library, &set, "dhdSetForceAndTorque") || open_device() < 0)
        return 3;
    for (int call = 0; call < 100; call++)
        set(0.0, 0.0, 2.0, 0.0, 0.0, 0.0, -1);
    int calls = strcmp(way, "square") == 0 ? 4000 : 500;
    for (int call = 0; call < calls; call++) {
        double side = call % 2 ? 40.0 : -40.0;
        if (strcmp(way, "huge") == 0)
            set(1e308, -1e308, 1e308, 1e308, 1e308, -1e308, -1);
        else if (strcmp(way, "nan") == 0)
            set(NAN, NAN, NAN, 0.0, 0.0, 0.0, -1);
        else
            set(side, 0.0, side, 0.0, 0.0, 0.0, -1);
    }
    return close_device(-1) < 0;
}
