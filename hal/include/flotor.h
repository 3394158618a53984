/* Flotor's plugin contract for C and C++ authors. Generated from the Rust sources: do not edit.
 *
 * SI units everywhere: m, rad, s, N, N m, J; time in integer nanoseconds. Right-handed frames, z up.
 * A wrench is the force and torque on the hand. Orientation is a unit quaternion [x, y, z, w].
 * A plugin exports one FlotorEntry and one FLOTOR_METADATA text; see the book, "Plugin contract".
 *
 * Memory that the host passes by pointer is initialised, also for out parameters, and belongs to the callee during the
 * call. One instance is used by one thread at a time, except `safe_stop`, which may come from any thread;
 * `get_interface`, `create` and `open` may come from several threads at once. The host checks indices and values of
 * parameters before a plugin sees them.
 */
#ifndef FLOTOR_H
#define FLOTOR_H

#include <stdint.h>
#include <stddef.h>

// Capacity of a [`Message`], bytes.
#define FLOTOR_MESSAGE_BYTES 508

// Major version of the contract; contracts of different major versions are incompatible.
#define FLOTOR_ABI_MAJOR 1

// Minor version of the contract; a later minor version only adds to the contract.
#define FLOTOR_ABI_MINOR 0

// 1 for a release candidate of this contract version, 0 for the release.
#define FLOTOR_ABI_CANDIDATE 1

// [`Host::flags`] bit: the plugin has its own Rust runtime and may replace its panic hook with a silent hook.
#define FLOTOR_HOST_QUIET_PANICS 1

// Maximum number of coefficients of a calibration: a polynomial of degree seven.
#define FLOTOR_CALIBRATION_COEFFICIENTS 8

// Largest number of contacts in a set.
#define FLOTOR_MAX_CONTACTS 16

// Capacity of a stop message, bytes.
#define FLOTOR_STOP_MESSAGE_BYTES 64

// Largest number of ports of an object.
#define FlotorMAX_PORTS 4

// Status returned by a table function.
enum FlotorCallStatus
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Success.
    FlotorCallStatus_Ok = 0,
    // The plugin panicked, now or earlier; the instance is disabled.
    FlotorCallStatus_Panicked = 1,
    // The call is not allowed in the current phase of the device (such as `capabilities` of an active device).
    FlotorCallStatus_WrongPhase = 2,
    // A value, an index or a capacity is out of range, or the parameter cannot be changed now.
    FlotorCallStatus_OutOfRange = 3,
    // The plugin does not offer this function.
    FlotorCallStatus_Unsupported = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorCallStatus FlotorCallStatus;
#else
typedef uint32_t FlotorCallStatus;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Kind of a plugin, by its main interface.
enum FlotorPluginKind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Force model: offers `flotor.force/1`.
    FlotorPluginKind_Model = 1,
    // Device: offers `flotor.device/1`.
    FlotorPluginKind_Device = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorPluginKind FlotorPluginKind;
#else
typedef uint32_t FlotorPluginKind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Kind of a refusal: a closed set that a host maps to exit codes and advice.
enum FlotorRefusalKind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // A parameter has an unusable value: change the value.
    FlotorRefusalKind_Parameter = 1,
    // The plugin does not support the request (rate, demand, capability): choose another plugin or scene.
    FlotorRefusalKind_Unsupported = 2,
    // Hardware or a file is missing, busy or not permitted: fix the machine, then retry.
    FlotorRefusalKind_Resource = 3,
    // The plugin panicked or violated the contract: report this to its author.
    FlotorRefusalKind_Broken = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorRefusalKind FlotorRefusalKind;
#else
typedef uint32_t FlotorRefusalKind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Kind of a parameter: the meaning of its numeric value.
enum FlotorParameterKind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // A real number between `min` and `max`, in `unit`.
    FlotorParameterKind_Real = 1,
    // One of `choices`; the number is its index.
    FlotorParameterKind_Choice = 2,
    // Free text (a serial number); set at creation only.
    FlotorParameterKind_Text = 3,
    // File, or one of `choices`, which are built in; set at creation only. A host passes a path that can be opened from
    // its working directory, and resolves a relative path in a scene against the folder of the scene.
    FlotorParameterKind_File = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorParameterKind FlotorParameterKind;
#else
typedef uint32_t FlotorParameterKind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Times at which a parameter may be set.
enum FlotorMutability
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Only when the instance is created.
    FlotorMutability_Fixed = 0,
    // At any tick boundary while the loop runs.
    FlotorMutability_Live = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorMutability FlotorMutability;
#else
typedef uint32_t FlotorMutability;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Status of a model's output.
enum FlotorStepStatus
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // The law is valid at this input.
    FlotorStepStatus_Ok = 0,
    // The output was saturated to stay finite and safe.
    FlotorStepStatus_Clamped = 1,
    // The pose is outside the model's domain; the wrench is the best safe continuation.
    FlotorStepStatus_OutOfDomain = 2,
    // An iteration has not reached its tolerance yet.
    FlotorStepStatus_NotConverged = 3,
    // The input was not finite; the wrench is zero.
    FlotorStepStatus_InvalidInput = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorStepStatus FlotorStepStatus;
#else
typedef uint32_t FlotorStepStatus;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Path dependence of the force: a path-dependent model has an internal state.
enum FlotorMemory
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // The wrench depends on the current input only: inputs may be evaluated in any order.
    FlotorMemory_Stateless = 0,
    // The wrench also depends on earlier inputs (iteration, friction, contact, branches).
    FlotorMemory_PathDependent = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorMemory FlotorMemory;
#else
typedef uint32_t FlotorMemory;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Fault of a device: a closed set, each fault with a remedy.
enum FlotorFault
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // The handle left the sensor's range: move the handle back, then start again.
    FlotorFault_SensorOutOfRange = 1,
    // A coil is too hot: let it cool.
    FlotorFault_OverTemperature = 2,
    // A coil carried too much current for too long: reduce the load.
    FlotorFault_OverCurrent = 3,
    // The handle moved faster than the device allows: move the handle more slowly.
    FlotorFault_OverSpeed = 4,
    // The device is disconnected: check cable and power.
    FlotorFault_Disconnected = 5,
    // The device did not respond in time.
    FlotorFault_Timeout = 6,
    // The device sent malformed data.
    FlotorFault_Protocol = 7,
    // The emergency stop of the device is pressed.
    FlotorFault_EmergencyStop = 8,
    // The plugin panicked or returned a code outside the contract: report the fault to its author.
    FlotorFault_Broken = 9,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorFault FlotorFault;
#else
typedef uint32_t FlotorFault;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Embodiment of a device: a physical handle, or a simulation only; a closed set.
enum FlotorEmbodiment
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Handle that a hand can hold; the default.
    FlotorEmbodiment_Physical = 0,
    // Simulation: no command ever reaches an actuator that could push a hand.
    FlotorEmbodiment_Simulated = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorEmbodiment FlotorEmbodiment;
#else
typedef uint32_t FlotorEmbodiment;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Access path to a USB device, as a closed set. In C, a `uint32_t` with these values.
enum FlotorUsbAccess
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // USB bus, without a kernel driver.
    FlotorUsbAccess_Raw = 0,
    // Serial port of the kernel.
    FlotorUsbAccess_Serial = 1,
    // Raw HID interface of the kernel.
    FlotorUsbAccess_Hid = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorUsbAccess FlotorUsbAccess;
#else
typedef uint32_t FlotorUsbAccess;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Final state of a stopped device. In C, a `uint32_t` with these values.
enum FlotorStoppedState
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // No force.
    FlotorStoppedState_Zero = 0,
    // No force, after a controlled landing of the handle.
    FlotorStoppedState_Landed = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorStoppedState FlotorStoppedState;
#else
typedef uint32_t FlotorStoppedState;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Kind of a grip, which decides the units of all its numbers. In C, a `uint32_t` with these values.
enum FlotorGripKind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Opening in m, velocity in m/s, effort in N.
    FlotorGripKind_Linear = 0,
    // Opening in rad, velocity in rad/s, effort in N·m.
    FlotorGripKind_Angular = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorGripKind FlotorGripKind;
#else
typedef uint32_t FlotorGripKind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Form of a [`Primitive`]. In C, a `uint32_t` with these values.
enum FlotorForm
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Rectangle normal to the z axis of the pose; the solid is on the side of negative z.
    FlotorForm_Plane = 0,
    // A ball.
    FlotorForm_Sphere = 1,
    // A box with sides along the axes of the pose.
    FlotorForm_Box = 2,
    // A round cylinder about the z axis of the pose.
    FlotorForm_Cylinder = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorForm FlotorForm;
#else
typedef uint32_t FlotorForm;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Role of a [`Primitive`]: touched body or tool. In C, a `uint32_t` with these values.
enum FlotorPart
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Body that the tool touches.
    FlotorPart_Body = 0,
    // Tool in the hand.
    FlotorPart_Tool = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorPart FlotorPart;
#else
typedef uint32_t FlotorPart;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Visible sides of a surface. In C, a `uint32_t` with these values.
enum FlotorSides
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Outside only: the surface encloses a body.
    FlotorSides_Outer = 0,
    // Both sides: a sheet.
    FlotorSides_Both = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum FlotorSides FlotorSides;
#else
typedef uint32_t FlotorSides;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Row of the layout table: a field, or a whole struct.
typedef struct FlotorFieldLayout {
    // `Struct.field`, or `Struct` for the whole struct; padded with zeros.
    uint8_t name[48];
    // Offset of the field in its struct, bytes; 0 for a struct.
    uint32_t offset;
    // Size of the field or struct, bytes.
    uint32_t size;
} FlotorFieldLayout;

// Host information that a plugin receives once, before any other call.
typedef struct FlotorHost {
    // Size of this struct in the host's build, bytes.
    uint32_t size;
    // Major version of the host's contract.
    uint16_t abi_major;
    // Minor version of the host's contract.
    uint16_t abi_minor;
    // [`HOST_QUIET_PANICS`] or 0.
    uint32_t flags;
    // Reserved, 0.
    uint32_t reserved;
} FlotorHost;

// Borrowed UTF-8 text. A text in a schema or an info struct lives as long as the process (plugins are never unloaded);
// a text in an argument lives for the call.
typedef struct FlotorStr {
    const uint8_t *ptr;
    size_t len;
} FlotorStr;

// Second, independent check of the layouts, by abi_stable; null in C plugins and in builds without the feature
// `layout-proof`.
typedef struct FlotorLayoutProof {
    // Size of this struct in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // `abi_stable::library::AbiHeader`; the layouts below are readable only if the header is valid.
    const void *abi_stable_header;
    // Returns the `abi_stable::type_layout::TypeLayout` of a contract type by name, or null.
    const void *(*layout_of)(struct FlotorStr name);
} FlotorLayoutProof;

// The exported static `flotor_entry_<crate>`: plain data, readable before any plugin code runs.
typedef struct FlotorEntry {
    // [`MAGIC`].
    uint8_t magic[8];
    // Size of this struct in the plugin's build, bytes.
    uint32_t size;
    // Major version of the plugin's contract.
    uint16_t abi_major;
    // Minor version of the plugin's contract.
    uint16_t abi_minor;
    // Code of a [`PluginKind`].
    uint32_t kind;
    // [`ABI_CANDIDATE`] of the contract the plugin was built for.
    uint32_t abi_candidate;
    // The layout table of the plugin's build.
    const struct FlotorFieldLayout *layouts;
    // Number of rows of `layouts`.
    uint32_t layout_count;
    // Reserved, 0.
    uint32_t reserved;
    // Called once after loading, before any other function. May be null.
    void (*init)(const struct FlotorHost *host);
    // Returns the table of an interface id, or null if not offered.
    const void *(*get_interface)(struct FlotorStr id);
    // Second check of the layouts, or null.
    const struct FlotorLayoutProof *layout_proof;
} FlotorEntry;

// Constant list of words, built by [`crate::choices!`].
typedef struct FlotorChoices {
    const struct FlotorStr *ptr;
    size_t len;
} FlotorChoices;

// Entry of a plugin's schema. Built with [`Parameter::real`], [`Parameter::choice`], [`Parameter::text`] or
// [`Parameter::file`].
typedef struct FlotorParameter {
    struct FlotorStr id;
    struct FlotorStr unit;
    struct FlotorStr doc;
    struct FlotorChoices choices;
    uint32_t kind;
    uint32_t mutability;
    double min;
    double max;
    double default_;
} FlotorParameter;

// Outputs that a scene needs from a step; other outputs need not be computed.
//
// The shape is not an output of a step: observers query the shape outside the loop, through the extensions
// [`crate::extension::centerline`] and [`crate::extension::shape`].
typedef struct FlotorDemand {
    uint32_t bits;
} FlotorDemand;

// Declaration of a force model; constant, readable without creating an instance.
typedef struct FlotorModelInfo {
    struct FlotorStr id;
    struct FlotorStr name;
    struct FlotorStr doc;
    struct FlotorDemand serves;
    uint32_t memory;
} FlotorModelInfo;

// Value at the plugin boundary: index into the schema, number, text (of texts and files).
typedef struct FlotorParameterValue {
    uint32_t index;
    uint32_t reserved;
    double number;
    struct FlotorStr text;
} FlotorParameterValue;

// Message for users, at most [`MESSAGE_BYTES`] bytes of UTF-8, written by the callee to memory of the caller: nothing to
// allocate or to free.
typedef struct FlotorMessage {
    uint32_t len;
    uint8_t text[FLOTOR_MESSAGE_BYTES];
} FlotorMessage;

// Opaque pointer to an instance of a model or device, created and owned by a plugin.
typedef void *FlotorInstance;

// Loop settings that a plugin receives before the start. 16 bytes.
typedef struct FlotorLoopConfig {
    // Nominal time between ticks, ns.
    uint64_t period_ns;
    // Seed of all random numbers of this run.
    uint64_t seed;
} FlotorLoopConfig;

// Position and orientation of the handle. 56 bytes.
typedef struct FlotorPose {
    // Position of the handle, m.
    double position_m[3];
    // Unit quaternion `[x, y, z, w]`, handle frame to the frame the pose is given in.
    double orientation_xyzw[4];
} FlotorPose;

// Linear and angular velocity of the handle. 48 bytes.
typedef struct FlotorTwist {
    // Linear velocity of the handle, m/s.
    double linear_m_per_s[3];
    // Angular velocity, rad/s.
    double angular_rad_per_s[3];
} FlotorTwist;

// Input of a force model for one step. 136 bytes, in the **model frame**.
typedef struct FlotorInput {
    // Pose of the handle relative to the model's home, m and unit quaternion.
    struct FlotorPose pose;
    // Velocity of the handle, m/s and rad/s; the linear part is scaled like the position.
    struct FlotorTwist twist;
    // Time since the loop started, ns.
    uint64_t time_ns;
    // Time since the previous step, ns (0 on the first).
    uint64_t dt_ns;
    // Number of the tick, from 0.
    uint64_t tick;
    // Buttons of the device, one bit each: 1 while pressed.
    uint32_t buttons;
    // Outputs that the model must compute.
    struct FlotorDemand demand;
} FlotorInput;

// Force and torque **on the hand**, at the handle. 48 bytes.
//
// A compressed spring pushes the hand up: positive compression, positive z force.
typedef struct FlotorWrench {
    // Force, N.
    double force_n[3];
    // Torque, N·m.
    double torque_nm[3];
} FlotorWrench;

// Output of one step. 64 bytes, in the model frame.
typedef struct FlotorOutput {
    // Force and torque on the hand, N and N·m.
    struct FlotorWrench wrench;
    // Stored energy, J, if demanded and served; NaN where the model has none.
    double energy_j;
    uint32_t status;
    uint32_t reserved;
} FlotorOutput;

// Function table `flotor.force/1`. Statuses are [`super::CallStatus`] codes; `create` and `prepare` return 0, or a
// [`crate::RefusalKind`] with the reason in the message.
typedef struct FlotorForceTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Number of parameters.
    uint32_t parameter_count;
    // Parameter schema, constant.
    const struct FlotorParameter *parameters;
    // Declaration of the model: id, texts, and the demands and path dependence that cover all settings; constant.
    struct FlotorModelInfo info;
    // Creates an instance from explicitly set values and writes the instance to `out`. Not real-time.
    uint32_t (*create)(const struct FlotorParameterValue *values,
                       uint32_t count,
                       struct FlotorMessage *message,
                       FlotorInstance *out);
    // Frees an instance. Not real-time.
    void (*destroy)(FlotorInstance instance);
    // Prepares an instance for the loop: its last opportunity to allocate. Not real-time. May be null.
    uint32_t (*prepare)(FlotorInstance instance,
                        const struct FlotorLoopConfig *config,
                        struct FlotorMessage *message);
    // Computes the output (wrench, energy, status) for an input. Real-time: no allocation, lock, system call or
    // unwinding.
    uint32_t (*step)(FlotorInstance instance, const struct FlotorInput *input, struct FlotorOutput *output);
    // Computes the outputs for `count` inputs in order. Real-time per input. May be null: the host then calls `step`.
    uint32_t (*step_batch)(FlotorInstance instance,
                           uint64_t count,
                           const struct FlotorInput *inputs,
                           struct FlotorOutput *outputs);
    // Changes the live parameter at `index` at a tick boundary (for a choice, `value` is its index). Real-time. May be
    // null.
    uint32_t (*set_parameter)(FlotorInstance instance, uint32_t index, double value);
    // Returns the current value of the parameter at `index`; NaN if unknown. Real-time. May be null.
    double (*parameter)(FlotorInstance instance, uint32_t index);
    // Clears the history, keeps the parameters. Real-time. May be null.
    uint32_t (*reset)(FlotorInstance instance);
    // Writes the message of the last failure to `message`; empty if there is none. Not real-time. May be null.
    void (*last_message)(FlotorInstance instance, struct FlotorMessage *message);
} FlotorForceTable;

// Declaration of a device; constant, readable without opening the device.
typedef struct FlotorDeviceInfo {
    struct FlotorStr id;
    struct FlotorStr name;
    struct FlotorStr doc;
    // Code of an [`Embodiment`].
    uint32_t embodiment;
    // Reserved, 0.
    uint32_t reserved;
} FlotorDeviceInfo;

// Set of axes that a device senses or actuates: x, y, z, then rotation about x, y, z.
typedef struct FlotorAxes {
    uint32_t bits;
} FlotorAxes;

// Capabilities of a device, as numbers that a host compares with a model and enforces. 200 bytes, device frame.
//
// Every number is finite and not negative, and constant from `open` on; a host rejects other capabilities before
// activation. An actuated axis needs a limit above 0 and, if sensed, a range above 0; actuated axes need a slew rate
// above 0. Only without actuated translations (rotations) may the slew rate of force (torque) be infinite.
typedef struct FlotorCapabilities {
    // Axes whose position is measured.
    struct FlotorAxes sensed;
    // Axes that can be driven.
    struct FlotorAxes actuated;
    // Largest displacement from the origin along each axis, m; together the semi-axes of an ellipsoid.
    double range_m[3];
    // Largest rotation about each axis, rad; together the semi-axes of an ellipsoid of rotation vectors.
    double range_rad[3];
    // Position resolution, m: smallest step that the sensors resolve.
    double resolution_m;
    // Largest force along each axis, N.
    double max_force_n[3];
    // Largest torque about each axis, N·m.
    double max_torque_nm[3];
    // Maximum slew rate of the force that the device accepts, N/s.
    double max_force_slew_n_per_s;
    // Maximum slew rate of the torque that the device accepts, N·m/s.
    double max_torque_slew_nm_per_s;
    // Largest stiffness that the device renders stably at its nominal rate with its recommended damping, N/m; 0:
    // unknown. [`SampledLoop::largest_stiffness`](crate::SampledLoop::largest_stiffness) computes this limit from
    // damping and timing.
    double max_stiffness_n_per_m;
    // Lowest and highest loop rate of the device, Hz.
    double rate_hz[2];
    // Time from a sample to the resulting force, s, in addition to the hold of the force over one period.
    double latency_s;
} FlotorCapabilities;

// Result of `read` and `write` at the plugin boundary, 4 bytes. A separate type, so that no other code of the contract can be
// mistaken for a result.
typedef struct FlotorCycleCode {
    // 0: fresh; 1: stale; 256 plus the code of a [`crate::Fault`]: fault.
    uint32_t code;
} FlotorCycleCode;

// Number and scheduled time of a tick. 24 bytes.
typedef struct FlotorTick {
    // Number of the tick, from 0.
    uint64_t index;
    // Scheduled time since the loop started, ns: free of jitter, so that runs can be repeated.
    uint64_t time_ns;
    // Scheduled time since the previous tick, ns; more than a period after missed ticks; 0 on the first.
    uint64_t dt_ns;
} FlotorTick;

// Conditions of a sample other than faults, as a bit set; no condition ends a run.
typedef struct FlotorConditions {
    uint32_t bits;
} FlotorConditions;

// Sample that a device reports each tick. 168 bytes, in the device frame.
typedef struct FlotorDeviceState {
    // Pose of the handle, m and unit quaternion.
    struct FlotorPose pose;
    // Velocity of the handle, m/s and rad/s.
    struct FlotorTwist twist;
    // Wrench delivered to the hand since the previous tick, as reported by the device, N and N·m.
    struct FlotorWrench delivered;
    // Time of the sample, ns, on the clock of [`Tick::time_ns`].
    uint64_t sampled_ns;
    // Buttons, one bit each: 1 while pressed.
    uint32_t buttons;
    // Conditions of this sample other than faults.
    struct FlotorConditions conditions;
} FlotorDeviceState;

// Function table `flotor.device/1`. `open` and `activate` return 0, or a [`crate::RefusalKind`] with the reason in the
// message; `read` and `write` return a [`CycleCode`]; the other functions with a `uint32_t` result return a
// [`super::CallStatus`] code.
typedef struct FlotorDeviceTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Number of parameters.
    uint32_t parameter_count;
    // Parameter schema, constant.
    const struct FlotorParameter *parameters;
    // Id, name and description of the device, constant.
    struct FlotorDeviceInfo info;
    // Opens a device with explicitly set values and writes the instance to `out`. May block. Not real-time.
    uint32_t (*open)(const struct FlotorParameterValue *values,
                     uint32_t count,
                     struct FlotorMessage *message,
                     FlotorInstance *out);
    // Closes the device; deactivates an active device first. Not real-time.
    void (*close)(FlotorInstance instance);
    // Writes the capabilities of an opened device to `out`. Not real-time.
    uint32_t (*capabilities)(FlotorInstance instance, struct FlotorCapabilities *out);
    // Energises the device at zero wrench. Not real-time.
    uint32_t (*activate)(FlotorInstance instance,
                         const struct FlotorLoopConfig *config,
                         struct FlotorMessage *message);
    // Commands zero wrench and returns to the opened phase. Not real-time.
    uint32_t (*deactivate)(FlotorInstance instance);
    // Reads the newest sample of an active device into `state`. Real-time.
    struct FlotorCycleCode (*read)(FlotorInstance instance,
                                   const struct FlotorTick *tick,
                                   struct FlotorDeviceState *state);
    // Commands the wrench on the hand until the next write; of an active device only. Real-time.
    struct FlotorCycleCode (*write)(FlotorInstance instance,
                                    const struct FlotorTick *tick,
                                    const struct FlotorWrench *wrench);
    // Sets the actuators to zero (or starts a controlled landing) at once, until the next activation. May be called from
    // any thread at any time, also during `read` and `write`.
    void (*safe_stop)(FlotorInstance instance);
    // Changes the live parameter at `index` of an active device at a tick boundary (for a choice, `value` is its index).
    // Real-time. May be null.
    uint32_t (*set_parameter)(FlotorInstance instance, uint32_t index, double value);
    // Returns the current value of the parameter at `index` of an opened device; NaN if unknown. May be null.
    double (*parameter)(FlotorInstance instance, uint32_t index);
    // Writes the message of the last failure to `message`; empty if there is none. Not real-time. May be null.
    void (*last_message)(FlotorInstance instance, struct FlotorMessage *message);
} FlotorDeviceTable;

// Drawing style of the body around its centreline: a tube, or a wire wound about the centreline. 40 bytes.
typedef struct FlotorCenterlineInfo {
    // Radius of the drawn tube or wire, m.
    double tube_radius_m;
    // Radius of the wire's helix about the centreline, m; 0 draws a plain tube.
    double helix_radius_m;
    // Turns of the helix over the whole length; 0 for a plain tube.
    double helix_turns;
    // Radius of the end plates, m; 0 for none.
    double plate_radius_m;
    // Recommended number of points on the centreline.
    uint32_t suggested_points;
    uint32_t reserved;
} FlotorCenterlineInfo;

// Function table `flotor.centerline/1`: see [`CenterlineModel`]. Not real-time.
typedef struct FlotorCenterlineTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the drawing style of the body; returns a [`crate::abi::CallStatus`] code.
    uint32_t (*info)(FlotorInstance instance, struct FlotorCenterlineInfo *out);
    // Fills up to `capacity` points from the fixed end to the handle and writes the number of valid points to `count`;
    // returns a [`crate::abi::CallStatus`] code.
    uint32_t (*centerline)(FlotorInstance instance,
                           const struct FlotorInput *input,
                           struct FlotorPose *points,
                           uint32_t capacity,
                           uint32_t *count);
} FlotorCenterlineTable;

// Body of a simple form. 88 bytes.
typedef struct FlotorPrimitive {
    // Code of a [`Form`].
    uint32_t form;
    // Code of a [`Part`].
    uint32_t part;
    // Centre (m, model frame) and orientation.
    struct FlotorPose pose;
    // Half extents along the axes of the pose, m.
    double half_sides_m[3];
} FlotorPrimitive;

// Vertex of the surface. 56 bytes.
typedef struct FlotorSurfaceVertex {
    // Position, m, model frame.
    double position_m[3];
    // Outward unit normal.
    double normal[3];
    // Value of the scalar field at this vertex, in the unit of [`ScalarField`]; 0 without a field.
    double value;
} FlotorSurfaceVertex;

// Name and unit of the vertex values of a surface. 32 bytes.
typedef struct FlotorScalarField {
    struct FlotorStr name;
    struct FlotorStr unit;
} FlotorScalarField;

// View of a [`Shape`] at the plugin boundary: the plugin's own memory, valid until the next call of the instance. 88 bytes.
typedef struct FlotorShapeView {
    // Bodies of simple form, and the tool; like `vertices` and `triangles`, may be null if empty.
    const struct FlotorPrimitive *primitives;
    // Vertices of the surface.
    const struct FlotorSurfaceVertex *vertices;
    // Triangles of the surface: indices of vertices, counter-clockwise seen from outside.
    const uint32_t (*triangles)[3];
    // Number of primitives.
    uint32_t primitive_count;
    // Number of vertices.
    uint32_t vertex_count;
    // Number of triangles.
    uint32_t triangle_count;
    // Code of [`Sides`].
    uint32_t sides;
    // Name and unit of the vertex values; the texts are constant.
    struct FlotorScalarField field;
} FlotorShapeView;

// Function table `flotor.shape/1`: see [`ShapeModel`]. Not real-time.
typedef struct FlotorShapeTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the shape at an input; returns a [`crate::abi::CallStatus`] code.
    uint32_t (*shape)(FlotorInstance instance, const struct FlotorInput *input, struct FlotorShapeView *out);
} FlotorShapeTable;

// Soft range of one parameter, in its unit. 40 bytes.
typedef struct FlotorSoftRange {
    struct FlotorStr id;
    double min;
    double max;
    double step;
} FlotorSoftRange;

// Function table `flotor.soft-range/1`: see [`SoftRangeModel`].
typedef struct FlotorSoftRangeTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Number of ranges.
    uint32_t range_count;
    // Soft ranges, constant.
    const struct FlotorSoftRange *ranges;
} FlotorSoftRangeTable;

// Demands that one instance serves, and its path dependence; constant over the life of the instance. 8 bytes.
typedef struct FlotorVariantInfo {
    struct FlotorDemand serves;
    uint32_t memory;
} FlotorVariantInfo;

// Function table `flotor.variant/1`: see [`VariantModel`]. Not real-time.
typedef struct FlotorVariantTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes demands and memory of an instance, with the settings it was created with; returns a [`crate::abi::CallStatus`] code.
    uint32_t (*info)(FlotorInstance instance, struct FlotorVariantInfo *out);
} FlotorVariantTable;

// Positions of the handle, in the model frame, at which a model may act. 56 bytes.
//
// Outside the region wrench and stored energy are **zero at every orientation and velocity**, and the model has
// **no history**: the first step inside is as after [`ForceModel::reset`]. The region may be larger than
// necessary, never smaller: the host skips the step outside without a check.
typedef struct FlotorActiveRegion {
    uint32_t shape;
    uint32_t reserved;
    double center_m[3];
    double half_sides_m[3];
} FlotorActiveRegion;

// Function table `flotor.active-region/1`: see [`ActiveRegionModel`]. Real-time.
typedef struct FlotorActiveRegionTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the active region with the current parameters; returns a [`crate::abi::CallStatus`] code.
    uint32_t (*region)(FlotorInstance instance, struct FlotorActiveRegion *out);
} FlotorActiveRegionTable;

// Diagnostic number of a step. Built with [`Detail::number`], [`Detail::word`] or [`Detail::flag`].
typedef struct FlotorDetail {
    struct FlotorStr id;
    struct FlotorStr unit;
    struct FlotorStr doc;
    struct FlotorChoices words;
} FlotorDetail;

// Function table `flotor.details/1`: see [`DetailsModel`].
typedef struct FlotorDetailsTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Number of details.
    uint32_t detail_count;
    // Diagnostic numbers, constant.
    const struct FlotorDetail *details;
    // Writes the `detail_count` values of the last step, NaN for a missing value; returns a [`crate::abi::CallStatus`]
    // code, `OutOfRange` if `capacity` is smaller than `detail_count`. Real-time: no allocation, lock, system call or
    // unwinding.
    uint32_t (*values)(FlotorInstance instance, double *values, uint32_t capacity);
} FlotorDetailsTable;

// Contact between a point of the tool and a plane that stands for the surface nearby, in the model frame. 136 bytes.
typedef struct FlotorContact {
    // Point on the tool, relative to the handle and in its orientation, m; zero for a tool that is a point.
    double tool_point_m[3];
    // Closest point on the surface at the anchor, m.
    double surface_point_m[3];
    // Unit normal of the surface, towards the tool.
    double normal[3];
    // Distance of the point on the tool from the surface at the anchor, along the normal, m; below 0 inside.
    double gap_m;
    // Velocity of the surface, m/s. Its power is the model's: a host limits it.
    double surface_velocity_m_per_s[3];
    // Stiffness along the normal, N/m; above 0.
    double stiffness_n_per_m;
    // Stiffness across the normal while the contact sticks, N/m; 0: no friction.
    double tangential_stiffness_n_per_m;
    // Damping along the normal, N·s/m.
    double damping_ns_per_m;
    // Coefficient of friction.
    double friction;
} FlotorContact;

// Wrench around a pose, in the model frame: `W(d) = W0 - K d`. 416 bytes.
//
// `d` is the displacement from the anchor: position in m, then the rotation vector of the turn from the anchor's
// orientation, in rad. `K` is a stiffness: positive where the model pushes back.
typedef struct FlotorLinearField {
    // Pose at which the field is exact.
    struct FlotorPose anchor;
    // Wrench on the hand at the anchor, N and N·m.
    struct FlotorWrench wrench;
    // Stiffness matrix `K = -dW/dd`. Rows: force x, y, z (N), torque x, y, z (N·m); columns: position x, y, z (m),
    // rotation x, y, z (rad).
    double stiffness[6][6];
    // Radius of validity about the anchor, m; beyond, a host uses the wrench at that distance in the same direction.
    double valid_m;
    // Largest valid rotation from the orientation of the anchor, rad.
    double valid_rad;
    // Loop time for which the field was computed, ns.
    uint64_t time_ns;
} FlotorLinearField;

// Contacts near a pose, in the model frame. 2688 bytes.
typedef struct FlotorContactSet {
    // Pose of the handle for which the contacts were computed.
    struct FlotorPose anchor;
    // Contacts; only the first [`Self::count`] count.
    struct FlotorContact contacts[FLOTOR_MAX_CONTACTS];
    // Number of contacts.
    uint32_t count;
    // 1 with a bilateral part, 0 without.
    uint32_t has_field;
    // Largest displacement from the anchor for which the set is valid, m; above 0, may be infinite. Beyond, a host continues the
    // planes and counts the ticks.
    double valid_m;
    // Largest rotation from the anchor for which the set is valid, rad; above 0, may be infinite.
    double valid_rad;
    // Longest age for which the set is valid, s; 0: three periods of the model. The forces of an older set fade.
    double valid_s;
    // Bilateral part, a force that also pulls; read only if [`Self::has_field`] is not 0.
    struct FlotorLinearField field;
    // Loop time for which the set was computed, ns.
    uint64_t time_ns;
} FlotorContactSet;

// Function table `flotor.contact-set/1`: see [`ContactSetModel`].
typedef struct FlotorContactSetTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the contacts at an input, after the time since the previous call; returns a [`crate::abi::CallStatus`]
    // code. Not real-time, but bounded.
    uint32_t (*contact_set)(FlotorInstance instance,
                            const struct FlotorInput *input,
                            struct FlotorContactSet *set);
} FlotorContactSetTable;

// Function table `flotor.linear-field/1`: see [`LinearFieldModel`].
typedef struct FlotorLinearFieldTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the field at an input, after the time since the previous call; returns a [`crate::abi::CallStatus`] code.
    // Not real-time, but bounded.
    uint32_t (*linear_field)(FlotorInstance instance,
                             const struct FlotorInput *input,
                             struct FlotorLinearField *field);
} FlotorLinearFieldTable;

// Positions of the handle, in the model frame, for which a model is valid: a box along the axes. 48 bytes.
typedef struct FlotorWorkspaceBounds {
    double lower_m[3];
    double upper_m[3];
} FlotorWorkspaceBounds;

// Function table `flotor.workspace-bounds/1`: see [`WorkspaceBoundsModel`]. Real-time.
typedef struct FlotorWorkspaceBoundsTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the limits with the current parameters; returns a [`crate::abi::CallStatus`] code.
    uint32_t (*bounds)(FlotorInstance instance, struct FlotorWorkspaceBounds *out);
} FlotorWorkspaceBoundsTable;

// Balance of the mechanical energy of a device with a known plant (a simulation), J since activation. 56 bytes.
//
// Every term is integrated separately, none is the difference of others, so that this balance is a check:
// `stored_j - initial_j = actuators_j + feedforward_j + hand_j - dissipated_j`.
typedef struct FlotorEnergyLedger {
    // Kinetic and potential energy now, J.
    double stored_j;
    // Kinetic and potential energy at activation, J.
    double initial_j;
    // Work done on the handle by the actuators for the commanded wrench, J.
    double actuators_j;
    // Work done on the handle by the actuators for gravity compensation, J.
    double feedforward_j;
    // Work done on the handle by the hand, J.
    double hand_j;
    // Energy turned into heat by damping, J.
    double dissipated_j;
    // Largest mechanical energy so far (kinetic, plus potential above its lowest point), J: the scale of the residual.
    double peak_j;
} FlotorEnergyLedger;

// Function table `flotor.energy-ledger/1`: see [`EnergyLedgerDevice`].
typedef struct FlotorEnergyLedgerTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the energy balance since activation; returns a [`crate::abi::CallStatus`] code. Real-time.
    uint32_t (*ledger)(FlotorInstance instance, struct FlotorEnergyLedger *out);
} FlotorEnergyLedgerTable;

// Ratio of delivered to commanded vertical force, as a polynomial of the height in m. 80 bytes.
typedef struct FlotorVerticalCalibration {
    double range_m[2];
    double coefficients[FLOTOR_CALIBRATION_COEFFICIENTS];
} FlotorVerticalCalibration;

// Function table `flotor.calibration/1`: see [`CalibrationDevice`]. Both calls are valid in the opened phase only.
typedef struct FlotorCalibrationTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the serial number of the hardware, empty if none; returns a [`crate::abi::CallStatus`] code. Not real-time.
    uint32_t (*serial)(FlotorInstance instance, struct FlotorMessage *serial);
    // Corrects the total vertical command from the next activation on; returns 0, or a [`crate::RefusalKind`] with the
    // reason in the message. Not real-time.
    uint32_t (*calibrate_vertical)(FlotorInstance instance,
                                   const struct FlotorVerticalCalibration *calibration,
                                   struct FlotorMessage *message);
} FlotorCalibrationTable;

// USB identity of a device: vendor, product and access path. 8 bytes.
typedef struct FlotorUsbKind {
    uint16_t vendor;
    uint16_t product;
    // Code of a [`UsbAccess`].
    uint32_t access;
} FlotorUsbKind;

// Function table `flotor.connection/1`: see [`ConnectionDevice`].
typedef struct FlotorConnectionTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Number of USB identities.
    uint32_t usb_count;
    // USB identities of the device, constant.
    const struct FlotorUsbKind *usb;
} FlotorConnectionTable;

// Stop of a device that does not depend on the host's process. 88 bytes.
typedef struct FlotorIndependentStop {
    // Time from the end of the host's commands, or from the message, until the device is in its safe state, ns. The
    // largest number with descriptor -1: no independent stop.
    uint64_t within_ns;
    // File descriptor of the host's process, open for writing until the device is closed; the host duplicates the
    // descriptor. On Windows the lower 32 bits of a handle. -1: the device stops by itself without commands.
    int32_t descriptor;
    // Length of the message, bytes, 1 to 64; 0 with descriptor -1.
    uint32_t length;
    // Message written to the descriptor, up to three times: stops the device at any time, also after a partial command.
    uint8_t message[FLOTOR_STOP_MESSAGE_BYTES];
    // Code of a [`StoppedState`].
    uint32_t state;
    // Reserved, 0.
    uint32_t reserved;
} FlotorIndependentStop;

// Function table `flotor.independent-stop/1`: see [`IndependentStopDevice`]. Valid in the opened phase only.
typedef struct FlotorIndependentStopTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the independent stop of the device; returns a [`crate::abi::CallStatus`] code. Not real-time.
    uint32_t (*independent_stop)(FlotorInstance instance, struct FlotorIndependentStop *stop);
} FlotorIndependentStopTable;

// Function table `flotor.pacing/1`: see [`PacingDevice`].
typedef struct FlotorPacingTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Waits for a sample that no earlier wait has reported, for `timeout_ns` at most; writes the number of samples
    // taken since the last successful wait, 0 after a timeout. Returns a [`crate::abi::CallStatus`] code. Real-time
    // except for the wait: no allocation.
    uint32_t (*wait_for_sample)(FlotorInstance instance, uint64_t timeout_ns, uint64_t *samples);
} FlotorPacingTable;

// Grip of a device as numbers that a host enforces, in the units of its kind. 40 bytes.
typedef struct FlotorGripAxis {
    // Code of a [`GripKind`].
    uint32_t kind;
    uint32_t reserved;
    // Opening of the closed and of the open grip.
    double range[2];
    // Largest effort in both directions; 0: the grip is sensed only.
    double max_effort;
    // Maximum slew rate of the effort, per s.
    double max_slew_per_s;
} FlotorGripAxis;

// Sample of a grip, in the units of its kind. 32 bytes.
typedef struct FlotorGripState {
    // Opening, larger when the grip is more open.
    double opening;
    // Velocity of the opening, positive while the grip opens.
    double velocity;
    // Effort delivered since the previous tick, as reported by the device.
    double delivered;
    // Code of a [`GripKind`], set by the host.
    uint32_t kind;
    uint32_t reserved;
} FlotorGripState;

// Function table `flotor.grip/1`: see [`GripDevice`], [`ActiveGrip`] and [`GripModel`]. A device sets the first three
// functions, a model the last. All return a [`crate::abi::CallStatus`] code.
typedef struct FlotorGripTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the grip of an opened device; `Unsupported` without one. Not real-time.
    uint32_t (*axis)(FlotorInstance instance, struct FlotorGripAxis *axis);
    // Writes the sample that the last `read` of an active device took. Real-time.
    uint32_t (*read)(FlotorInstance instance, struct FlotorGripState *state);
    // Sets the effort that the next `write` of an active device commands. Real-time.
    uint32_t (*write)(FlotorInstance instance, double effort);
    // Writes the effort of a model at a grip, right after the step with the same input. Real-time.
    uint32_t (*effort)(FlotorInstance instance,
                       const struct FlotorInput *input,
                       const struct FlotorGripState *grip,
                       double *effort);
} FlotorGripTable;

// Function table `flotor.snapshot/1`: see [`Restorable`]. Real-time: bounded by the size of the state. Calls on a device
// are valid in the active phase only. All return a [`crate::abi::CallStatus`] code.
typedef struct FlotorSnapshotTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the number of bytes of the state, constant while the instance is prepared or active.
    uint32_t (*count)(FlotorInstance instance, uint64_t *out);
    // Writes the state to `count` bytes; `OutOfRange` for another number of bytes.
    uint32_t (*save)(FlotorInstance instance, uint8_t *bytes, uint64_t count);
    // Restores a state from `count` bytes; `OutOfRange` for another number of bytes, and for bytes that are not a state:
    // the caller then resets or destroys the instance.
    uint32_t (*restore)(FlotorInstance instance, const uint8_t *bytes, uint64_t count);
} FlotorSnapshotTable;

// Function table `flotor.world/1`: see [`WorldModel`].
typedef struct FlotorWorldTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Steps the object once, with the inputs of `count` ports, and writes an output for each; `count` is at least 1 and at
    // most `MAX_PORTS`, else the status is `OutOfRange`. Returns a [`CallStatus`] code. Real-time.
    uint32_t (*step_ports)(FlotorInstance instance,
                           uint32_t count,
                           const struct FlotorInput *inputs,
                           struct FlotorOutput *outputs);
} FlotorWorldTable;

// Function table `flotor.world-contacts/1`: see [`WorldContactsModel`].
typedef struct FlotorWorldContactsTable {
    // Size of this table in the plugin's build, bytes.
    uint32_t size;
    // Reserved, 0.
    uint32_t reserved;
    // Writes the contacts at the inputs of `count` ports, after the time since the previous call; `count` is at least 1 and at
    // most `MAX_PORTS`, else the status is `OutOfRange`. Returns a [`CallStatus`] code. Not real-time, but bounded.
    uint32_t (*contact_sets)(FlotorInstance instance,
                             uint32_t count,
                             const struct FlotorInput *inputs,
                             struct FlotorContactSet *sets);
} FlotorWorldContactsTable;

/* Version of the contract, for the metadata. */
#define FLOTOR_CONTRACT "1.0-rc"
/* Names of interfaces and extensions. */
#define FLOTOR_INTERFACE_DEVICE "flotor.device/1"
#define FLOTOR_INTERFACE_FORCE "flotor.force/1"
#define FLOTOR_INTERFACE_ACTIVE_REGION "flotor.active-region/1"
#define FLOTOR_INTERFACE_CALIBRATION "flotor.calibration/1"
#define FLOTOR_INTERFACE_CENTERLINE "flotor.centerline/1"
#define FLOTOR_INTERFACE_CONNECTION "flotor.connection/1"
#define FLOTOR_INTERFACE_CONTACT_SET "flotor.contact-set/1"
#define FLOTOR_INTERFACE_DETAILS "flotor.details/1"
#define FLOTOR_INTERFACE_ENERGY_LEDGER "flotor.energy-ledger/1"
#define FLOTOR_INTERFACE_GRIP "flotor.grip/1"
#define FLOTOR_INTERFACE_INDEPENDENT_STOP "flotor.independent-stop/1"
#define FLOTOR_INTERFACE_LINEAR_FIELD "flotor.linear-field/1"
#define FLOTOR_INTERFACE_PACING "flotor.pacing/1"
#define FLOTOR_INTERFACE_SHAPE "flotor.shape/1"
#define FLOTOR_INTERFACE_SNAPSHOT "flotor.snapshot/1"
#define FLOTOR_INTERFACE_SOFT_RANGE "flotor.soft-range/1"
#define FLOTOR_INTERFACE_VARIANT "flotor.variant/1"
#define FLOTOR_INTERFACE_WORKSPACE_BOUNDS "flotor.workspace-bounds/1"
#define FLOTOR_INTERFACE_WORLD "flotor.world/1"
#define FLOTOR_INTERFACE_WORLD_CONTACTS "flotor.world-contacts/1"

#if defined(_WIN32)
#define FLOTOR_VISIBLE __declspec(dllexport)
#else
#define FLOTOR_VISIBLE __attribute__((visibility("default")))
#endif
#if defined(__cplusplus)
#define FLOTOR_EXPORT extern "C" FLOTOR_VISIBLE
#else
#define FLOTOR_EXPORT FLOTOR_VISIBLE
#endif

/* Begins the definition of the entry, in C as in C++:
 * `FLOTOR_ENTRY(flotor_entry_jelly) = { FLOTOR_ENTRY_HEAD(FlotorPluginKind_Model), NULL, get_interface, NULL };` */
#if defined(__cplusplus)
#define FLOTOR_ENTRY(name) \
    extern "C" { extern FLOTOR_VISIBLE const FlotorEntry name; } \
    const FlotorEntry name
#else
#define FLOTOR_ENTRY(name) \
    extern FLOTOR_VISIBLE const FlotorEntry name; \
    const FlotorEntry name
#endif
/* Everything of an entry before its functions. */
#define FLOTOR_ENTRY_HEAD(kind) \
    FLOTOR_MAGIC_BYTES, sizeof(FlotorEntry), FLOTOR_ABI_MAJOR, FLOTOR_ABI_MINOR, (kind), FLOTOR_ABI_CANDIDATE, \
    flotor_layouts, FLOTOR_LAYOUT_COUNT, 0

/* Sets of outputs: `{FLOTOR_DEMAND_FORCE | FLOTOR_DEMAND_ENERGY}` makes a FlotorDemand. */
#define FLOTOR_DEMAND_FORCE 1u
#define FLOTOR_DEMAND_TORQUE 2u
#define FLOTOR_DEMAND_ENERGY 4u
/* Sets of axes: `{FLOTOR_AXES_X | FLOTOR_AXES_RZ}` makes a FlotorAxes. */
#define FLOTOR_AXES_X 1u
#define FLOTOR_AXES_Y 2u
#define FLOTOR_AXES_Z 4u
#define FLOTOR_AXES_RX 8u
#define FLOTOR_AXES_RY 16u
#define FLOTOR_AXES_RZ 32u
#define FLOTOR_AXES_PLANE 3u
#define FLOTOR_AXES_TRANSLATION 7u
#define FLOTOR_AXES_ROTATION 56u
#define FLOTOR_AXES_ALL 63u
/* Sets of conditions: `{FLOTOR_CONDITIONS_SATURATED}` makes a FlotorConditions. */
#define FLOTOR_CONDITIONS_SATURATED 1u
#define FLOTOR_CONDITIONS_EXCESS_FORCE 2u
#define FLOTOR_CONDITIONS_NOISY 4u
/* Codes of `shape` in a FlotorActiveRegion. */
#define FLOTOR_REGION_EVERYWHERE 0u
#define FLOTOR_REGION_SPHERE 1u
#define FLOTOR_REGION_BOX 2u
/* Results of `read` and `write` of a device; a fault is one of FlotorFault. */
static inline FlotorCycleCode flotor_cycle(uint32_t code) {
    FlotorCycleCode cycle;
    cycle.code = code;
    return cycle;
}
#define FLOTOR_CYCLE_FRESH flotor_cycle(0u)
#define FLOTOR_CYCLE_STALE flotor_cycle(1u)
#define FLOTOR_CYCLE_FAULT(fault) flotor_cycle(0x100u | (uint32_t)(fault))

/* First eight bytes of an entry. */
#define FLOTOR_MAGIC_BYTES { 'F', 'L', 'O', 'T', 'O', 'R', '\r', '\n' }
/* Text from a string literal. */
#define FLOTOR_STR(literal) { (const uint8_t *)(literal), sizeof(literal) - 1 }
/* Metadata that a host reads from the file without running it, in TOML: kind ("model" or "device"), id, name, doc,
 * version, abi (FLOTOR_CONTRACT) and entry (the name of the exported FlotorEntry). */
#define FLOTOR_METADATA(text) \
    __attribute__((used, section(".flotor"))) static const char flotor_metadata[] = text

/* The layout table: every struct and every field as this compiler lays them out. The host compares it with its own. */
#define FLOTOR_STRUCT(name) { #name, 0, sizeof(Flotor##name) }
#define FLOTOR_FIELD(name, field) \
    { #name "." #field, offsetof(Flotor##name, field), sizeof(((Flotor##name *)0)->field) }
#define FLOTOR_FIELD_CALLED(name, text, field) \
    { #name "." text, offsetof(Flotor##name, field), sizeof(((Flotor##name *)0)->field) }
__attribute__((unused)) static const FlotorFieldLayout flotor_layouts[] = {
    FLOTOR_STRUCT(Str),
    FLOTOR_FIELD(Str, ptr),
    FLOTOR_FIELD(Str, len),
    FLOTOR_STRUCT(Choices),
    FLOTOR_FIELD(Choices, ptr),
    FLOTOR_FIELD(Choices, len),
    FLOTOR_STRUCT(Message),
    FLOTOR_FIELD(Message, len),
    FLOTOR_FIELD(Message, text),
    FLOTOR_STRUCT(Pose),
    FLOTOR_FIELD(Pose, position_m),
    FLOTOR_FIELD(Pose, orientation_xyzw),
    FLOTOR_STRUCT(Twist),
    FLOTOR_FIELD(Twist, linear_m_per_s),
    FLOTOR_FIELD(Twist, angular_rad_per_s),
    FLOTOR_STRUCT(Wrench),
    FLOTOR_FIELD(Wrench, force_n),
    FLOTOR_FIELD(Wrench, torque_nm),
    FLOTOR_STRUCT(Parameter),
    FLOTOR_FIELD(Parameter, id),
    FLOTOR_FIELD(Parameter, unit),
    FLOTOR_FIELD(Parameter, doc),
    FLOTOR_FIELD(Parameter, choices),
    FLOTOR_FIELD(Parameter, kind),
    FLOTOR_FIELD(Parameter, mutability),
    FLOTOR_FIELD(Parameter, min),
    FLOTOR_FIELD(Parameter, max),
    FLOTOR_FIELD_CALLED(Parameter, "default", default_),
    FLOTOR_STRUCT(ParameterValue),
    FLOTOR_FIELD(ParameterValue, index),
    FLOTOR_FIELD(ParameterValue, reserved),
    FLOTOR_FIELD(ParameterValue, number),
    FLOTOR_FIELD(ParameterValue, text),
    FLOTOR_STRUCT(Demand),
    FLOTOR_FIELD(Demand, bits),
    FLOTOR_STRUCT(Input),
    FLOTOR_FIELD(Input, pose),
    FLOTOR_FIELD(Input, twist),
    FLOTOR_FIELD(Input, time_ns),
    FLOTOR_FIELD(Input, dt_ns),
    FLOTOR_FIELD(Input, tick),
    FLOTOR_FIELD(Input, buttons),
    FLOTOR_FIELD(Input, demand),
    FLOTOR_STRUCT(Output),
    FLOTOR_FIELD(Output, wrench),
    FLOTOR_FIELD(Output, energy_j),
    FLOTOR_FIELD(Output, status),
    FLOTOR_FIELD(Output, reserved),
    FLOTOR_STRUCT(ModelInfo),
    FLOTOR_FIELD(ModelInfo, id),
    FLOTOR_FIELD(ModelInfo, name),
    FLOTOR_FIELD(ModelInfo, doc),
    FLOTOR_FIELD(ModelInfo, serves),
    FLOTOR_FIELD(ModelInfo, memory),
    FLOTOR_STRUCT(LoopConfig),
    FLOTOR_FIELD(LoopConfig, period_ns),
    FLOTOR_FIELD(LoopConfig, seed),
    FLOTOR_STRUCT(Tick),
    FLOTOR_FIELD(Tick, index),
    FLOTOR_FIELD(Tick, time_ns),
    FLOTOR_FIELD(Tick, dt_ns),
    FLOTOR_STRUCT(DeviceState),
    FLOTOR_FIELD(DeviceState, pose),
    FLOTOR_FIELD(DeviceState, twist),
    FLOTOR_FIELD(DeviceState, delivered),
    FLOTOR_FIELD(DeviceState, sampled_ns),
    FLOTOR_FIELD(DeviceState, buttons),
    FLOTOR_FIELD(DeviceState, conditions),
    FLOTOR_STRUCT(Conditions),
    FLOTOR_FIELD(Conditions, bits),
    FLOTOR_STRUCT(Axes),
    FLOTOR_FIELD(Axes, bits),
    FLOTOR_STRUCT(Capabilities),
    FLOTOR_FIELD(Capabilities, sensed),
    FLOTOR_FIELD(Capabilities, actuated),
    FLOTOR_FIELD(Capabilities, range_m),
    FLOTOR_FIELD(Capabilities, range_rad),
    FLOTOR_FIELD(Capabilities, resolution_m),
    FLOTOR_FIELD(Capabilities, max_force_n),
    FLOTOR_FIELD(Capabilities, max_torque_nm),
    FLOTOR_FIELD(Capabilities, max_force_slew_n_per_s),
    FLOTOR_FIELD(Capabilities, max_torque_slew_nm_per_s),
    FLOTOR_FIELD(Capabilities, max_stiffness_n_per_m),
    FLOTOR_FIELD(Capabilities, rate_hz),
    FLOTOR_FIELD(Capabilities, latency_s),
    FLOTOR_STRUCT(DeviceInfo),
    FLOTOR_FIELD(DeviceInfo, id),
    FLOTOR_FIELD(DeviceInfo, name),
    FLOTOR_FIELD(DeviceInfo, doc),
    FLOTOR_FIELD(DeviceInfo, embodiment),
    FLOTOR_FIELD(DeviceInfo, reserved),
    FLOTOR_STRUCT(Host),
    FLOTOR_FIELD(Host, size),
    FLOTOR_FIELD(Host, abi_major),
    FLOTOR_FIELD(Host, abi_minor),
    FLOTOR_FIELD(Host, flags),
    FLOTOR_FIELD(Host, reserved),
    FLOTOR_STRUCT(FieldLayout),
    FLOTOR_FIELD(FieldLayout, name),
    FLOTOR_FIELD(FieldLayout, offset),
    FLOTOR_FIELD(FieldLayout, size),
    FLOTOR_STRUCT(ForceTable),
    FLOTOR_FIELD(ForceTable, size),
    FLOTOR_FIELD(ForceTable, parameter_count),
    FLOTOR_FIELD(ForceTable, parameters),
    FLOTOR_FIELD(ForceTable, info),
    FLOTOR_FIELD(ForceTable, create),
    FLOTOR_FIELD(ForceTable, destroy),
    FLOTOR_FIELD(ForceTable, prepare),
    FLOTOR_FIELD(ForceTable, step),
    FLOTOR_FIELD(ForceTable, step_batch),
    FLOTOR_FIELD(ForceTable, set_parameter),
    FLOTOR_FIELD(ForceTable, parameter),
    FLOTOR_FIELD(ForceTable, reset),
    FLOTOR_FIELD(ForceTable, last_message),
    FLOTOR_STRUCT(CycleCode),
    FLOTOR_FIELD(CycleCode, code),
    FLOTOR_STRUCT(DeviceTable),
    FLOTOR_FIELD(DeviceTable, size),
    FLOTOR_FIELD(DeviceTable, parameter_count),
    FLOTOR_FIELD(DeviceTable, parameters),
    FLOTOR_FIELD(DeviceTable, info),
    FLOTOR_FIELD(DeviceTable, open),
    FLOTOR_FIELD(DeviceTable, close),
    FLOTOR_FIELD(DeviceTable, capabilities),
    FLOTOR_FIELD(DeviceTable, activate),
    FLOTOR_FIELD(DeviceTable, deactivate),
    FLOTOR_FIELD(DeviceTable, read),
    FLOTOR_FIELD(DeviceTable, write),
    FLOTOR_FIELD(DeviceTable, safe_stop),
    FLOTOR_FIELD(DeviceTable, set_parameter),
    FLOTOR_FIELD(DeviceTable, parameter),
    FLOTOR_FIELD(DeviceTable, last_message),
    FLOTOR_STRUCT(ActiveRegion),
    FLOTOR_FIELD(ActiveRegion, shape),
    FLOTOR_FIELD(ActiveRegion, reserved),
    FLOTOR_FIELD(ActiveRegion, center_m),
    FLOTOR_FIELD(ActiveRegion, half_sides_m),
    FLOTOR_STRUCT(ActiveRegionTable),
    FLOTOR_FIELD(ActiveRegionTable, size),
    FLOTOR_FIELD(ActiveRegionTable, reserved),
    FLOTOR_FIELD(ActiveRegionTable, region),
    FLOTOR_STRUCT(CenterlineInfo),
    FLOTOR_FIELD(CenterlineInfo, tube_radius_m),
    FLOTOR_FIELD(CenterlineInfo, helix_radius_m),
    FLOTOR_FIELD(CenterlineInfo, helix_turns),
    FLOTOR_FIELD(CenterlineInfo, plate_radius_m),
    FLOTOR_FIELD(CenterlineInfo, suggested_points),
    FLOTOR_FIELD(CenterlineInfo, reserved),
    FLOTOR_STRUCT(CenterlineTable),
    FLOTOR_FIELD(CenterlineTable, size),
    FLOTOR_FIELD(CenterlineTable, reserved),
    FLOTOR_FIELD(CenterlineTable, info),
    FLOTOR_FIELD(CenterlineTable, centerline),
    FLOTOR_STRUCT(Contact),
    FLOTOR_FIELD(Contact, tool_point_m),
    FLOTOR_FIELD(Contact, surface_point_m),
    FLOTOR_FIELD(Contact, normal),
    FLOTOR_FIELD(Contact, gap_m),
    FLOTOR_FIELD(Contact, surface_velocity_m_per_s),
    FLOTOR_FIELD(Contact, stiffness_n_per_m),
    FLOTOR_FIELD(Contact, tangential_stiffness_n_per_m),
    FLOTOR_FIELD(Contact, damping_ns_per_m),
    FLOTOR_FIELD(Contact, friction),
    FLOTOR_STRUCT(ContactSet),
    FLOTOR_FIELD(ContactSet, anchor),
    FLOTOR_FIELD(ContactSet, contacts),
    FLOTOR_FIELD(ContactSet, count),
    FLOTOR_FIELD(ContactSet, has_field),
    FLOTOR_FIELD(ContactSet, valid_m),
    FLOTOR_FIELD(ContactSet, valid_rad),
    FLOTOR_FIELD(ContactSet, valid_s),
    FLOTOR_FIELD(ContactSet, field),
    FLOTOR_FIELD(ContactSet, time_ns),
    FLOTOR_STRUCT(ContactSetTable),
    FLOTOR_FIELD(ContactSetTable, size),
    FLOTOR_FIELD(ContactSetTable, reserved),
    FLOTOR_FIELD(ContactSetTable, contact_set),
    FLOTOR_STRUCT(Detail),
    FLOTOR_FIELD(Detail, id),
    FLOTOR_FIELD(Detail, unit),
    FLOTOR_FIELD(Detail, doc),
    FLOTOR_FIELD(Detail, words),
    FLOTOR_STRUCT(DetailsTable),
    FLOTOR_FIELD(DetailsTable, size),
    FLOTOR_FIELD(DetailsTable, detail_count),
    FLOTOR_FIELD(DetailsTable, details),
    FLOTOR_FIELD(DetailsTable, values),
    FLOTOR_STRUCT(GripAxis),
    FLOTOR_FIELD(GripAxis, kind),
    FLOTOR_FIELD(GripAxis, reserved),
    FLOTOR_FIELD(GripAxis, range),
    FLOTOR_FIELD(GripAxis, max_effort),
    FLOTOR_FIELD(GripAxis, max_slew_per_s),
    FLOTOR_STRUCT(GripState),
    FLOTOR_FIELD(GripState, opening),
    FLOTOR_FIELD(GripState, velocity),
    FLOTOR_FIELD(GripState, delivered),
    FLOTOR_FIELD(GripState, kind),
    FLOTOR_FIELD(GripState, reserved),
    FLOTOR_STRUCT(GripTable),
    FLOTOR_FIELD(GripTable, size),
    FLOTOR_FIELD(GripTable, reserved),
    FLOTOR_FIELD(GripTable, axis),
    FLOTOR_FIELD(GripTable, read),
    FLOTOR_FIELD(GripTable, write),
    FLOTOR_FIELD(GripTable, effort),
    FLOTOR_STRUCT(LinearField),
    FLOTOR_FIELD(LinearField, anchor),
    FLOTOR_FIELD(LinearField, wrench),
    FLOTOR_FIELD(LinearField, stiffness),
    FLOTOR_FIELD(LinearField, valid_m),
    FLOTOR_FIELD(LinearField, valid_rad),
    FLOTOR_FIELD(LinearField, time_ns),
    FLOTOR_STRUCT(LinearFieldTable),
    FLOTOR_FIELD(LinearFieldTable, size),
    FLOTOR_FIELD(LinearFieldTable, reserved),
    FLOTOR_FIELD(LinearFieldTable, linear_field),
    FLOTOR_STRUCT(Primitive),
    FLOTOR_FIELD(Primitive, form),
    FLOTOR_FIELD(Primitive, part),
    FLOTOR_FIELD(Primitive, pose),
    FLOTOR_FIELD(Primitive, half_sides_m),
    FLOTOR_STRUCT(SurfaceVertex),
    FLOTOR_FIELD(SurfaceVertex, position_m),
    FLOTOR_FIELD(SurfaceVertex, normal),
    FLOTOR_FIELD(SurfaceVertex, value),
    FLOTOR_STRUCT(ScalarField),
    FLOTOR_FIELD(ScalarField, name),
    FLOTOR_FIELD(ScalarField, unit),
    FLOTOR_STRUCT(ShapeView),
    FLOTOR_FIELD(ShapeView, primitives),
    FLOTOR_FIELD(ShapeView, vertices),
    FLOTOR_FIELD(ShapeView, triangles),
    FLOTOR_FIELD(ShapeView, primitive_count),
    FLOTOR_FIELD(ShapeView, vertex_count),
    FLOTOR_FIELD(ShapeView, triangle_count),
    FLOTOR_FIELD(ShapeView, sides),
    FLOTOR_FIELD(ShapeView, field),
    FLOTOR_STRUCT(ShapeTable),
    FLOTOR_FIELD(ShapeTable, size),
    FLOTOR_FIELD(ShapeTable, reserved),
    FLOTOR_FIELD(ShapeTable, shape),
    FLOTOR_STRUCT(SnapshotTable),
    FLOTOR_FIELD(SnapshotTable, size),
    FLOTOR_FIELD(SnapshotTable, reserved),
    FLOTOR_FIELD(SnapshotTable, count),
    FLOTOR_FIELD(SnapshotTable, save),
    FLOTOR_FIELD(SnapshotTable, restore),
    FLOTOR_STRUCT(SoftRange),
    FLOTOR_FIELD(SoftRange, id),
    FLOTOR_FIELD(SoftRange, min),
    FLOTOR_FIELD(SoftRange, max),
    FLOTOR_FIELD(SoftRange, step),
    FLOTOR_STRUCT(SoftRangeTable),
    FLOTOR_FIELD(SoftRangeTable, size),
    FLOTOR_FIELD(SoftRangeTable, range_count),
    FLOTOR_FIELD(SoftRangeTable, ranges),
    FLOTOR_STRUCT(VariantInfo),
    FLOTOR_FIELD(VariantInfo, serves),
    FLOTOR_FIELD(VariantInfo, memory),
    FLOTOR_STRUCT(VariantTable),
    FLOTOR_FIELD(VariantTable, size),
    FLOTOR_FIELD(VariantTable, reserved),
    FLOTOR_FIELD(VariantTable, info),
    FLOTOR_STRUCT(WorkspaceBounds),
    FLOTOR_FIELD(WorkspaceBounds, lower_m),
    FLOTOR_FIELD(WorkspaceBounds, upper_m),
    FLOTOR_STRUCT(WorkspaceBoundsTable),
    FLOTOR_FIELD(WorkspaceBoundsTable, size),
    FLOTOR_FIELD(WorkspaceBoundsTable, reserved),
    FLOTOR_FIELD(WorkspaceBoundsTable, bounds),
    FLOTOR_STRUCT(WorldTable),
    FLOTOR_FIELD(WorldTable, size),
    FLOTOR_FIELD(WorldTable, reserved),
    FLOTOR_FIELD(WorldTable, step_ports),
    FLOTOR_STRUCT(WorldContactsTable),
    FLOTOR_FIELD(WorldContactsTable, size),
    FLOTOR_FIELD(WorldContactsTable, reserved),
    FLOTOR_FIELD(WorldContactsTable, contact_sets),
    FLOTOR_STRUCT(VerticalCalibration),
    FLOTOR_FIELD(VerticalCalibration, range_m),
    FLOTOR_FIELD(VerticalCalibration, coefficients),
    FLOTOR_STRUCT(CalibrationTable),
    FLOTOR_FIELD(CalibrationTable, size),
    FLOTOR_FIELD(CalibrationTable, reserved),
    FLOTOR_FIELD(CalibrationTable, serial),
    FLOTOR_FIELD(CalibrationTable, calibrate_vertical),
    FLOTOR_STRUCT(UsbKind),
    FLOTOR_FIELD(UsbKind, vendor),
    FLOTOR_FIELD(UsbKind, product),
    FLOTOR_FIELD(UsbKind, access),
    FLOTOR_STRUCT(ConnectionTable),
    FLOTOR_FIELD(ConnectionTable, size),
    FLOTOR_FIELD(ConnectionTable, usb_count),
    FLOTOR_FIELD(ConnectionTable, usb),
    FLOTOR_STRUCT(EnergyLedger),
    FLOTOR_FIELD(EnergyLedger, stored_j),
    FLOTOR_FIELD(EnergyLedger, initial_j),
    FLOTOR_FIELD(EnergyLedger, actuators_j),
    FLOTOR_FIELD(EnergyLedger, feedforward_j),
    FLOTOR_FIELD(EnergyLedger, hand_j),
    FLOTOR_FIELD(EnergyLedger, dissipated_j),
    FLOTOR_FIELD(EnergyLedger, peak_j),
    FLOTOR_STRUCT(EnergyLedgerTable),
    FLOTOR_FIELD(EnergyLedgerTable, size),
    FLOTOR_FIELD(EnergyLedgerTable, reserved),
    FLOTOR_FIELD(EnergyLedgerTable, ledger),
    FLOTOR_STRUCT(IndependentStop),
    FLOTOR_FIELD(IndependentStop, within_ns),
    FLOTOR_FIELD(IndependentStop, descriptor),
    FLOTOR_FIELD(IndependentStop, length),
    FLOTOR_FIELD(IndependentStop, message),
    FLOTOR_FIELD(IndependentStop, state),
    FLOTOR_FIELD(IndependentStop, reserved),
    FLOTOR_STRUCT(IndependentStopTable),
    FLOTOR_FIELD(IndependentStopTable, size),
    FLOTOR_FIELD(IndependentStopTable, reserved),
    FLOTOR_FIELD(IndependentStopTable, independent_stop),
    FLOTOR_STRUCT(PacingTable),
    FLOTOR_FIELD(PacingTable, size),
    FLOTOR_FIELD(PacingTable, reserved),
    FLOTOR_FIELD(PacingTable, wait_for_sample),
};
#define FLOTOR_LAYOUT_COUNT (sizeof flotor_layouts / sizeof *flotor_layouts)

#endif /* FLOTOR_H */
