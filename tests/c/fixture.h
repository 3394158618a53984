/* What the plugins of the tests share: the description in a section of the file, the table and the entry. */
#pragma once
#include "flotor.h"
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

static inline bool is_called(FlotorStr id, const char *name) {
    return id.len == strlen(name) && memcmp(id.ptr, name, id.len) == 0;
}

/* The description of a plugin whose entry is `flotor_entry_NAME`. */
#define DESCRIPTION(kind_, name_, id_, title, doc_)                                                                       \
    FLOTOR_METADATA("kind = \"" kind_ "\"\nid = \"" id_ "\"\nname = \"" title "\"\ndoc = \"" doc_ "\"\nversion = \"0.1.0\"\n" \
                    "abi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_" #name_ "\"\n")

/* The entry `flotor_entry_NAME` of a plugin that has a function `get_interface`. */
#define ENTRY(kind_, name_) FLOTOR_ENTRY(flotor_entry_##name_) = {FLOTOR_ENTRY_HEAD(kind_), .get_interface = get_interface}

/* The entry of a plugin with one interface, whose table is `table`. */
#define ENTRY_OF_TABLE(kind_, name_, interface)                                                                           \
    static const void *get_interface(FlotorStr id) { return is_called(id, interface) ? &table : NULL; }                   \
    ENTRY(kind_, name_)

/* The description and the table of a device; the last arguments are the other fields of the table. */
#define DEVICE_TABLE(name_, id_, title, doc_, ...)                                                                        \
    DESCRIPTION("device", name_, id_, title, doc_);                                                                       \
    static const FlotorDeviceTable table = {                                                                              \
        .size = sizeof(FlotorDeviceTable),                                                                                \
        .info = {.id = FLOTOR_STR(id_), .name = FLOTOR_STR(title), .doc = FLOTOR_STR(doc_)},                              \
        __VA_ARGS__}

/* A device without extensions. */
#define DEVICE(name_, ...)                                                                                                \
    DEVICE_TABLE(name_, __VA_ARGS__);                                                                                     \
    ENTRY_OF_TABLE(FlotorPluginKind_Device, name_, FLOTOR_INTERFACE_DEVICE)

/* A model without extensions that gives force and torque; the last arguments are the other fields of its table. */
#define MODEL(name_, id_, title, doc_, memory_, ...)                                                                      \
    DESCRIPTION("model", name_, id_, title, doc_);                                                                        \
    static const FlotorForceTable table = {                                                                               \
        .size = sizeof(FlotorForceTable),                                                                                 \
        .info = {.id = FLOTOR_STR(id_), .name = FLOTOR_STR(title), .doc = FLOTOR_STR(doc_),                                \
                 .serves = {FLOTOR_DEMAND_FORCE | FLOTOR_DEMAND_TORQUE}, .memory = memory_},                              \
        __VA_ARGS__};                                                                                                     \
    ENTRY_OF_TABLE(FlotorPluginKind_Model, name_, FLOTOR_INTERFACE_FORCE)
