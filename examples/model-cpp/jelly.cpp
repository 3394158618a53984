// A force model in C++: a jelly that gives way in every direction, and declares its active region.
#include "flotor.h"
#include <cmath>
#include <cstring>
#include <new>

FLOTOR_METADATA("kind = \"model\"\nid = \"jelly-cpp\"\nname = \"Jelly\"\ndoc = \"A soft block, in C++\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_jelly\"\n");

namespace {

constexpr double stiffness_n_per_m = 300.0;
constexpr double radius_m = 0.02;
constexpr double farthest_m = 1.0e3;

class Jelly {
public:
    // Real-time: bounded, no allocation.
    uint32_t step(const FlotorInput &input, FlotorOutput &output) const {
        output = FlotorOutput{};
        for (int axis = 0; axis < 3; axis++) {
            const double at_m = input.pose.position_m[axis];
            // True for NaN too. Far beyond this distance the energy would overflow.
            if (!(std::fabs(at_m) < farthest_m)) {
                output = FlotorOutput{};
                output.status = FlotorStepStatus_InvalidInput;
                return FlotorCallStatus_Ok;
            }
            output.wrench.force_n[axis] = -stiffness_n_per_m * at_m;
            output.energy_j += 0.5 * stiffness_n_per_m * at_m * at_m;
        }
        return FlotorCallStatus_Ok;
    }
};

uint32_t create(const FlotorParameterValue *, uint32_t, FlotorMessage *, FlotorInstance *out) {
    *out = new (std::nothrow) Jelly;
    return *out == nullptr ? uint32_t{FlotorRefusalKind_Resource} : 0u;
}

void destroy(FlotorInstance instance) {
    delete static_cast<Jelly *>(instance);
}

uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    return static_cast<const Jelly *>(instance)->step(*input, *output);
}

uint32_t region(FlotorInstance, FlotorActiveRegion *out) {
    *out = FlotorActiveRegion{FLOTOR_REGION_EVERYWHERE, 0, {0.0, 0.0, 0.0}, {radius_m, radius_m, radius_m}};
    return FlotorCallStatus_Ok;
}

FlotorForceTable force_table() {
    FlotorForceTable table{};
    table.size = sizeof table;
    table.info = {FLOTOR_STR("jelly-cpp"), FLOTOR_STR("Jelly"), FLOTOR_STR("A soft block, in C++"),
                  {FLOTOR_DEMAND_FORCE | FLOTOR_DEMAND_TORQUE | FLOTOR_DEMAND_ENERGY}, FlotorMemory_Stateless};
    table.create = create;
    table.destroy = destroy;
    table.step = step;
    return table;
}

const FlotorForceTable force = force_table();
const FlotorActiveRegionTable activity = {sizeof(FlotorActiveRegionTable), 0, region};

const void *get_interface(FlotorStr id) {
    const auto is = [&id](const char *name) {
        return id.len == std::strlen(name) && std::memcmp(id.ptr, name, id.len) == 0;
    };
    if (is(FLOTOR_INTERFACE_FORCE)) {
        return &force;
    }
    return is(FLOTOR_INTERFACE_ACTIVE_REGION) ? &activity : nullptr;
}

} // namespace

FLOTOR_ENTRY(flotor_entry_jelly) = {
    FLOTOR_ENTRY_HEAD(FlotorPluginKind_Model), nullptr, get_interface, nullptr,
};
