/* Interface between Flotor and a simulator: a program that computes contacts at a rate of its own.
 *
 * `flotor run` starts the program with a socket as its standard input (file descriptor 0). The socket keeps messages apart
 * (AF_UNIX, SOCK_SEQPACKET), has no name, and nobody else can connect to it. Flotor sends the pose of the handle at the rate of
 * the model; the program answers with the contacts near it, when and as often as it likes. Everything is SI and double, in the
 * byte order of the machine, in the frame of the model (z up).
 *
 *     FlotorSimulatorPose pose;
 *     while (flotor_simulator_receive(&pose) > 0) {
 *         FlotorSimulatorSet set = flotor_simulator_set(&pose);
 *         ... fill set.contacts, count them in set.count ...
 *         flotor_simulator_send(&set);
 *     }
 *
 * The end of Flotor's side is the end of the run: the program exits. */
#ifndef FLOTOR_SIMULATOR_H
#define FLOTOR_SIMULATOR_H

#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/types.h>

/* Version of this interface. */
#define FLOTOR_SIMULATOR_VERSION 1u
/* Largest number of contacts in a set. */
#define FLOTOR_SIMULATOR_CONTACTS 16

/* Pose of the handle, from Flotor to the program. 136 bytes. */
typedef struct FlotorSimulatorPose {
    uint32_t version;           /* FLOTOR_SIMULATOR_VERSION */
    uint32_t buttons;           /* one bit each: 1 while pressed */
    uint64_t number;            /* from 1, each one larger */
    uint64_t time_ns;           /* since the loop started */
    uint64_t period_ns;         /* nominal time between two poses */
    double position_m[3];
    double orientation_xyzw[4]; /* unit quaternion, handle to model */
    double linear_m_per_s[3];
    double angular_rad_per_s[3];
} FlotorSimulatorPose;

/* Contact between a point of the tool and a plane that stands for the surface nearby. 136 bytes. */
typedef struct FlotorSimulatorContact {
    double tool_point_m[3];     /* relative to the handle, in its orientation */
    double surface_point_m[3];  /* closest point of the surface */
    double normal[3];           /* unit normal, towards the tool */
    double gap_m;               /* distance of the tool point along the normal; below 0 inside */
    double surface_velocity_m_per_s[3];
    double stiffness_n_per_m;   /* above 0 */
    double tangential_stiffness_n_per_m; /* while the contact sticks; 0: no friction */
    double damping_ns_per_m;
    double friction;            /* coefficient */
} FlotorSimulatorContact;

/* Contacts near a pose, from the program to Flotor. Only the first `count` contacts are sent. */
typedef struct FlotorSimulatorSet {
    uint32_t version;           /* FLOTOR_SIMULATOR_VERSION */
    uint32_t count;
    uint64_t number;            /* of the pose for which the set was computed; never smaller than that of the set before */
    double valid_m;             /* largest displacement for which the planes hold; above 0, may be INFINITY */
    double valid_rad;           /* largest rotation */
    double valid_s;             /* longest age; 0: the parameter `valid_ms` */
    FlotorSimulatorContact contacts[FLOTOR_SIMULATOR_CONTACTS];
} FlotorSimulatorSet;

/* Waits for the newest pose. Returns 1, 0 at the end of the run, and -1 with errno on an error. */
static inline int flotor_simulator_receive(FlotorSimulatorPose *pose) {
    int has_one = 0;
    memset(pose, 0, sizeof *pose);
    for (;;) {
        FlotorSimulatorPose next;
        ssize_t size = recv(0, &next, sizeof next, has_one ? MSG_DONTWAIT : 0);
        if (size == (ssize_t)sizeof next && next.version == FLOTOR_SIMULATOR_VERSION) {
            *pose = next;
            has_one = 1;
        } else if (size == 0) {
            return 0;
        } else if (size > 0) {
            errno = EPROTO;
            return -1;
        } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
            return 1;
        } else if (errno != EINTR) {
            return errno == ECONNRESET ? 0 : -1;
        }
    }
}

/* Returns a set without contacts for a pose, valid everywhere. */
static inline FlotorSimulatorSet flotor_simulator_set(const FlotorSimulatorPose *pose) {
    FlotorSimulatorSet set;
    memset(&set, 0, sizeof set);
    set.version = FLOTOR_SIMULATOR_VERSION;
    set.number = pose->number;
    set.valid_m = INFINITY;
    set.valid_rad = INFINITY;
    return set;
}

/* Sends a set. Returns 1, 0 at the end of the run, and -1 with errno on an error. */
static inline int flotor_simulator_send(const FlotorSimulatorSet *set) {
    if (set->count > FLOTOR_SIMULATOR_CONTACTS) {
        errno = EINVAL;
        return -1;
    }
    size_t size = offsetof(FlotorSimulatorSet, contacts) + set->count * sizeof set->contacts[0];
    for (;;) {
        if (send(0, set, size, MSG_NOSIGNAL) >= 0) {
            return 1;
        }
        if (errno != EINTR) {
            return errno == EPIPE || errno == ECONNRESET ? 0 : -1;
        }
    }
}

#endif
