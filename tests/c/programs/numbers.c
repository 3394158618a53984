/* The numbers of two interfaces, written down a second time: a client of libHD or libdrd that asks for each parameter by its number
 * and makes each error happen that a program can. Says what is otherwise than in these tables; ends with the number of such lines. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

static void *library;
static int wrong;

static void expect(const char *what, long long found, long long wanted)
{
    if (found == wanted)
        return;
    printf("%s: %lld (0x%llx) instead of %lld (0x%llx)\n", what, found, found, wanted, wanted);
    wrong++;
}

static void find(void *function, const char *name)
{
    void *found = dlsym(library, name);
    expect(name, found == NULL, 0);
    memcpy(function, &found, sizeof found);
}

#define FIND(name) find(&name, #name)

/* --- 3D Systems' HD --- */

struct error { uint32_t code; int32_t internal; uint32_t device; };

static uint32_t (*hdInitDevice)(const char *), (*hdGetCurrentDevice)(void), (*hdCheckCalibration)(void);
static void (*hdDisableDevice)(uint32_t), (*hdBeginFrame)(uint32_t), (*hdEndFrame)(uint32_t);
static void (*hdGetBooleanv)(uint32_t, uint8_t *), (*hdGetIntegerv)(uint32_t, int *), (*hdGetLongv)(uint32_t, long *);
static void (*hdGetFloatv)(uint32_t, float *), (*hdGetDoublev)(uint32_t, double *);
static void (*hdSetDoublev)(uint32_t, const double *), (*hdSetIntegerv)(uint32_t, const int *);
static void (*hdEnable)(uint32_t), (*hdDisable)(uint32_t), (*hdUnschedule)(unsigned long), (*hdSetSchedulerRate)(unsigned long);
static uint8_t (*hdIsEnabled)(uint32_t);
static const char *(*hdGetString)(uint32_t), *(*hdGetErrorString)(uint32_t);
static struct error (*hdGetError)(void);

static void raised(const char *what, uint32_t code)
{
    expect(what, hdGetError().code, code);
    while (hdGetError().code != 0)
        ;
}

/* Number, type (boolean, integer, long, real) and how many there are. */
static const struct { uint32_t number; char type; int count; } PARAMETERS[] = {
    {0x2000, 'i', 1}, {0x2200, 'i', 1}, {0x2001, 'b', 1}, {0x2201, 'b', 1}, {0x2002, 'b', 1}, {0x2202, 'b', 1},
    {0x2010, 'l', 6}, {0x2210, 'l', 6}, {0x2011, 'r', 1}, {0x2012, 'r', 1}, {0x2050, 'r', 3}, {0x2250, 'r', 3},
    {0x2051, 'r', 3}, {0x2251, 'r', 3}, {0x2052, 'r', 16}, {0x2252, 'r', 16}, {0x2053, 'r', 3}, {0x2253, 'r', 3},
    {0x2100, 'r', 3}, {0x2300, 'r', 3}, {0x2150, 'r', 3}, {0x2350, 'r', 3}, {0x2505, 'r', 1}, {0x2550, 'r', 6},
    {0x2551, 'r', 6}, {0x2552, 'r', 1}, {0x2553, 'i', 1}, {0x2554, 'i', 1}, {0x2555, 'i', 1}, {0x2600, 'i', 1},
    {0x2601, 'i', 1}, {0x2602, 'r', 1}, {0x2603, 'r', 1}, {0x2604, 'r', 1}, {0x2606, 'r', 1}, {0x2607, 'r', 1},
    {0x2608, 'r', 1}, {0x2609, 'r', 1}, {0x2620, 'r', 1}, {0x2621, 'r', 1}, {0x2622, 'r', 1}, {0x2623, 'r', 1},
    {0x2700, 'r', 3}, {0x2800, 'r', 3}, {0x2701, 'r', 3}, {0x2801, 'r', 3}, {0x2703, 'r', 3}, {0x2802, 'r', 3},
    {0x2704, 'r', 3}, {0x2803, 'r', 3}, {0x2900, 'i', 1},
};

/* Asks as this type: how many bytes of the buffer were written, and the error. */
static int asked(uint32_t number, char type, uint32_t *code)
{
    unsigned char buffer[512], last = 0;
    int written = 0;
    memset(buffer, 0xa5, sizeof buffer);
    switch (type) {
    case 'b': hdGetBooleanv(number, buffer); break;
    case 'i': hdGetIntegerv(number, (int *)buffer); break;
    case 'l': hdGetLongv(number, (long *)buffer); break;
    case 'f': hdGetFloatv(number, (float *)buffer); break;
    default: hdGetDoublev(number, (double *)buffer); break;
    }
    for (int at = 0; at < (int)sizeof buffer; at++) {
        if (buffer[at] != 0xa5)
            written = at + 1;
        last = buffer[at];
    }
    expect("the end of the buffer", last, 0xa5);
    *code = hdGetError().code;
    return written;
}

static void parameters(void)
{
    const char *types = "bilr";
    char what[64];
    for (size_t row = 0; row < sizeof PARAMETERS / sizeof *PARAMETERS; row++) {
        uint32_t number = PARAMETERS[row].number, code;
        for (const char *type = types; *type; type++) {
            int size = *type == 'b' ? 1 : *type == 'i' ? 4 : 8, right = *type == PARAMETERS[row].type;
            int written = asked(number, *type, &code);
            snprintf(what, sizeof what, "0x%x as %c, error", number, *type);
            expect(what, code, right ? 0 : 0x0103);
            snprintf(what, sizeof what, "0x%x as %c, bytes", number, *type);
            expect(what, written, right ? size * PARAMETERS[row].count : 0);
        }
        if (PARAMETERS[row].type == 'r') {
            snprintf(what, sizeof what, "0x%x as float, bytes", number);
            expect(what, asked(number, 'f', &code), 4 * PARAMETERS[row].count);
        }
    }
    /* Of a motor there may be three or six. */
    uint32_t code;
    int written = asked(0x2605, 'r', &code);
    expect("0x2605", code == 0 && (written == 24 || written == 48), 1);
    expect("0x2750, bytes", asked(0x2750, 'l', &code), 0);
    expect("0x2750, error", code, 0x0100);
    expect("0x1234, bytes", asked(0x1234, 'r', &code), 0);
    expect("0x1234, error", code, 0x0100);
}

static void hd(void)
{
    FIND(hdInitDevice); FIND(hdGetCurrentDevice); FIND(hdCheckCalibration); FIND(hdDisableDevice); FIND(hdBeginFrame);
    FIND(hdEndFrame); FIND(hdGetBooleanv); FIND(hdGetIntegerv); FIND(hdGetLongv); FIND(hdGetFloatv); FIND(hdGetDoublev);
    FIND(hdSetDoublev); FIND(hdSetIntegerv); FIND(hdEnable); FIND(hdDisable); FIND(hdUnschedule); FIND(hdSetSchedulerRate);
    FIND(hdIsEnabled); FIND(hdGetString); FIND(hdGetErrorString); FIND(hdGetError);
    if (wrong)
        return;
    expect("the version before a device", hdGetString(0x2500) != NULL && *hdGetString(0x2500) != 0, 1);
    expect("an error of 12 bytes", sizeof(struct error), 12);
    expect("an unknown device", hdInitDevice("Phantom2"), 0xffffffff);
    raised("an unknown device, error", 0x0300);
    uint32_t device = hdInitDevice(NULL);
    expect("the first device", device, 0);
    raised("an initialised device, error", 0);
    expect("the same again", hdInitDevice("Default Device"), 0xffffffff);
    raised("the same again, error", 0x0301);
    expect("the current device", hdGetCurrentDevice(), device);
    expect("calibration", hdCheckCalibration(), 0x5000);
    for (uint32_t name = 0x2500; name <= 0x2504; name++)
        expect("a text", hdGetString(name) != NULL, 1);
    raised("the texts, error", 0);

    for (uint32_t switched = 0x4000; switched <= 0x4004; switched++) {
        expect("a capability at first", hdIsEnabled(switched), switched != 0x4000);
        hdDisable(switched);
        expect("disabled", hdIsEnabled(switched), 0);
        hdEnable(switched);
        expect("enabled", hdIsEnabled(switched), 1);
    }
    raised("capabilities, error", 0);
    hdEnable(0x4005);
    raised("no capability, error", 0x0100);

    double force[3] = {0.0, 0.0, 1.0}, read[3] = {9.0, 9.0, 9.0};
    hdSetDoublev(0x2700, force);
    raised("a force without a frame", 0x0402);
    hdEndFrame(device);
    raised("an end without a beginning", 0x0401);
    hdBeginFrame(777);
    raised("a frame of no device", 0x0104);
    hdBeginFrame(device);
    raised("a frame, error", 0);
    parameters();
    hdGetDoublev(0x2700, read);
    expect("no force was set in this frame", read[0] == 0.0 && read[1] == 0.0 && read[2] == 0.0, 1);
    hdSetDoublev(0x2700, force);
    raised("a force, error", 0);
    hdGetDoublev(0x2700, read);
    expect("the force of this frame", read[2] == 1.0, 1);
    hdSetDoublev(0x2050, force);
    raised("a position that is set", 0x0100);
    hdSetIntegerv(0x2700, &(int){1});
    raised("a force of whole numbers", 0x0103);
    hdEndFrame(device);
    raised("the end of the frame, error", 0);

    hdSetSchedulerRate(333);
    raised("333 Hz", 0x0101);
    hdSetSchedulerRate(1000);
    raised("1000 Hz", 0);
    hdUnschedule(12345);
    raised("nothing to unschedule", 0x0102);
    static const uint32_t CODES[] = {0x0000, 0x0100, 0x0101, 0x0102, 0x0103, 0x0104, 0x0200, 0x0201, 0x0202, 0x0203, 0x0204, 0x0300,
        0x0301, 0x0302, 0x0303, 0x0304, 0x0400, 0x0401, 0x0402, 0x0500, 0x0501, 0x0600};
    for (size_t code = 0; code < sizeof CODES / sizeof *CODES; code++)
        expect("a text of an error", strcmp(hdGetErrorString(CODES[code]), hdGetErrorString(0x7777)) != 0, 1);
    hdDisableDevice(device);
}

/* --- Force Dimension's DHD --- */

static int (*dhdGetDeviceCount)(void), (*dhdOpen)(void), (*dhdClose)(signed char), (*dhdErrorGetLast)(void);
static int (*dhdGetSystemType)(signed char), (*dhdGetStatus)(int *, signed char), (*dhdGetComMode)(signed char);
static int (*dhdGetPosition)(double *, double *, double *, signed char), (*dhdEnableForce)(unsigned char, signed char);
static int (*dhdSetBrakes)(int, signed char), (*dhdGetDeltaEncoders)(int *, int *, int *, signed char);
static int (*dhdSetDeltaMotor)(unsigned short, unsigned short, unsigned short, signed char);
static int (*dhdDeltaEncoderToPosition)(int, int, int, double *, double *, double *, signed char);
static int (*dhdDeltaEncodersToJointAngles)(int, int, int, double *, double *, double *, signed char);
static int (*dhdDeltaJointAnglesToJacobian)(double, double, double, double *, signed char);
static int (*dhdEnableExpertMode)(void), (*dhdDisableExpertMode)(void), (*dhdGetVelocityThreshold)(unsigned *, signed char);
static int (*drdMoveTo)(const double *, int, signed char);
static const char *(*dhdErrorGetStr)(int);

static void dhd(void)
{
    FIND(dhdGetDeviceCount); FIND(dhdOpen); FIND(dhdClose); FIND(dhdErrorGetLast); FIND(dhdGetSystemType); FIND(dhdGetStatus);
    FIND(dhdGetComMode); FIND(dhdGetPosition); FIND(dhdEnableForce); FIND(dhdSetBrakes); FIND(dhdGetDeltaEncoders);
    FIND(dhdSetDeltaMotor); FIND(dhdDeltaEncoderToPosition); FIND(dhdDeltaEncodersToJointAngles);
    FIND(dhdDeltaJointAnglesToJacobian); FIND(dhdEnableExpertMode); FIND(dhdDisableExpertMode); FIND(dhdGetVelocityThreshold);
    FIND(dhdErrorGetStr); FIND(drdMoveTo);
    if (wrong)
        return;
    double x, y, z;
    int status[17];
    unsigned threshold;
    expect("a position before anything is open", dhdGetPosition(&x, &y, &z, -1), -1);
    expect("its error", dhdErrorGetLast(), 5);
    expect("devices", dhdGetDeviceCount(), 1);
    expect("the first", dhdOpen(), 0);
    expect("a position", dhdGetPosition(&x, &y, &z, -1) >= 0, 1);
    expect("a way to nowhere", drdMoveTo(NULL, 0, -1), -1);
    expect("its error", dhdErrorGetLast(), 17);
    static const int TYPES[] = {33, 34, 35, 36, 37, 60, 63, 81, 82, 91, 104, 105, 108, 109, 131, 132, 203, 206};
    int known = 0;
    for (size_t type = 0; type < sizeof TYPES / sizeof *TYPES; type++)
        known |= dhdGetSystemType(-1) == TYPES[type];
    expect("a type that programs know", known, 1);
    expect("mode of communication: virtual", dhdGetComMode(-1), 3);
    /* 0 power, 1 connected, 2 started, 3 calibrated, 5 force, 6 brake, 9 error */
    expect("status", dhdGetStatus(status, -1) >= 0, 1);
    expect("power", status[0], 1);
    expect("connected", status[1], 1);
    expect("started", status[2], 1);
    expect("calibrated", status[3], 1);
    expect("force off", status[5], 0);
    expect("error", status[9], 0);
    expect("no brakes", dhdSetBrakes(0, -1), 0);
    dhdGetStatus(status, -1);
    expect("no brake", status[6], 0);
    expect("brakes", dhdSetBrakes(1, -1), 0);
    dhdGetStatus(status, -1);
    expect("a brake without force", status[6], 1);
    expect("force on", dhdEnableForce(1, -1), 0);
    dhdGetStatus(status, -1);
    expect("force", status[5], 1);
    expect("no brake with force", status[6], 0);
    expect("an expert's function for others", dhdGetVelocityThreshold(&threshold, -1), -1);
    expect("its error", dhdErrorGetLast(), 9);
    expect("an expert", dhdEnableExpertMode(), 0);
    expect("an expert's function", dhdGetVelocityThreshold(&threshold, -1) >= 0, 1);
    /* The Jacobian is constant: position = Jacobian * joints, to a count of 0.1 um. */
    int counts[3];
    double from[3], joints[3], jacobian[9];
    expect("encoders", dhdGetDeltaEncoders(&counts[0], &counts[1], &counts[2], -1), 0);
    dhdGetPosition(&x, &y, &z, -1);
    dhdDeltaEncoderToPosition(counts[0], counts[1], counts[2], &from[0], &from[1], &from[2], -1);
    expect("the position of the encoders", fabs(from[0] - x) + fabs(from[1] - y) + fabs(from[2] - z) < 3e-7, 1);
    dhdDeltaEncodersToJointAngles(counts[0], counts[1], counts[2], &joints[0], &joints[1], &joints[2], -1);
    dhdDeltaJointAnglesToJacobian(joints[0], joints[1], joints[2], jacobian, -1);
    for (int row = 0; row < 3; row++) {
        double sum = 0.0;
        for (int column = 0; column < 3; column++)
            sum += jacobian[3 * row + column] * joints[column];
        expect("the position of the joints", fabs(sum - from[row]) < 1e-12, 1);
    }
    expect("no motors", dhdSetDeltaMotor(0, 0, 0, -1), -1);
    expect("no motors, error", dhdErrorGetLast(), 10);
    expect("not an expert", dhdDisableExpertMode(), 0);
    for (int code = 0; code <= 22; code++)
        expect("a text of an error", strcmp(dhdErrorGetStr(code), dhdErrorGetStr(777)) != 0, 1);
    expect("closed", dhdClose(-1), 0);
}

int main(int argc, char **argv)
{
    int is_hd = argc > 1 && strcmp(argv[1], "hd") == 0;
    library = dlopen(is_hd ? "libHD.so" : "libdrd.so", RTLD_NOW);
    if (library == NULL) {
        printf("%s\n", dlerror());
        return 99;
    }
    if (is_hd)
        hd();
    else
        dhd();
    printf("%d wrong\n", wrong);
    return wrong > 90 ? 90 : wrong;
}
