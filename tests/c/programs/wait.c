/* A program that waits until somebody has moved the handle by 2 mm and commands nothing, as calibrations and "touch the sphere to
 * begin" do: of DHD or of CHAI3D's interface to a Phantom, for so many reads at most. */
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *library;
static int (*dhdOpen)(void), (*dhdGetPosition)(double *, double *, double *, signed char);
static int (*hdPhantomOpen)(int), (*hdPhantomGetPosition)(int, double *, double *, double *);

static void find(void *function, const char *name)
{
    void *found = dlsym(library, name);
    if (found == NULL)
        exit(3);
    memcpy(function, &found, sizeof found);
}

static double height(void)
{
    double x, y, z = 0.0;
    if (dhdGetPosition != NULL)
        dhdGetPosition(&x, &y, &z, -1);
    else
        hdPhantomGetPosition(0, &x, &y, &z);
    return z;
}

int main(int argc, char **argv)
{
    int is_dhd = argc > 1 && strcmp(argv[1], "dhd") == 0;
    long most = argc > 2 ? atol(argv[2]) : 0, reads = 0;
    library = dlopen(is_dhd ? "libdhd.so.3" : "libhdPhantom.so", RTLD_NOW);
    if (library == NULL)
        return 3;
    if (is_dhd) {
        find(&dhdOpen, "dhdOpen");
        find(&dhdGetPosition, "dhdGetPosition");
        if (dhdOpen() < 0)
            return 4;
    } else {
        find(&hdPhantomOpen, "hdPhantomOpen");
        find(&hdPhantomGetPosition, "hdPhantomGetPosition");
        if (hdPhantomOpen(0) < 0)
            return 4;
    }
    double first = height();
    while (fabs(height() - first) < 2.0e-3 && reads < most)
        reads++;
    printf("reads %ld\n", reads);
    return reads == most;
}
