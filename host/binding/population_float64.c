#include "population_float64.h"

#include "map/map_gen.h"
#include "map/population.h"

// A gate's coefficients begin at multiples of this.
enum { GATED = 2 * BT_ELECTRODES };

// 1, and the compression's centroid over its reaches.
static void gates_of(const int32_t e_q4[BT_ELECTRODES], double gate[3])
{
    double weight = 0, moment[2] = {0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double w = (e_q4[i] < 0 ? -e_q4[i] : 0) + BT_MAP_FLOOR_Q4;
        weight += w;
        moment[0] += w * bt_electrode_um[i][0];
        moment[1] += w * bt_electrode_um[i][1];
    }
    gate[0] = 1;
    gate[1] = moment[0] / weight / BT_MAP_REACH_X_UM;
    gate[2] = moment[1] / weight / BT_MAP_REACH_Y_UM;
}

static void add(double factor, const double coefficient[3], double sum[3])
{
    for (int d = 0; d < 3; d++) {
        sum[d] += factor * coefficient[d];
    }
}

void bt_population_replace(const double coefficient[BT_POPULATION_COLUMNS][3],
                           const uint16_t counts[BT_ELECTRODES], const int32_t tare_q4[BT_ELECTRODES],
                           double *results)
{
    int32_t e_q4[BT_ELECTRODES];
    double gate[3], force[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = counts[i] != BT_INVALID_COUNT ? 16 * counts[i] - tare_q4[i] : 0;
    }
    int32_t force_100un[3];
    bt_likeness likeness = bt_population_force(e_q4, force_100un);
    double share = likeness.share / (double)BT_POPULATION_ALL;
    gates_of(e_q4, gate);
    for (int g = 0; g < 3; g++) {
        double sum[3] = {0, 0, 0};
        for (int i = 0; i < BT_ELECTRODES; i++) {
            add(e_q4[i] / 16.0, coefficient[g * GATED + (e_q4[i] > 0 ? BT_ELECTRODES : 0) + i], sum);
        }
        add(gate[g], sum, force);
    }
    const double *poc = results;
    double *made = results + 3, *torque = results + 6;
    for (int d = 0; d < 3; d++) {
        made[d] = share * force[d] + (1 - share) * likeness.otherwise_100un[d] / 1e4;
    }
    torque[0] = poc[1] * made[2] - poc[2] * made[1];
}
