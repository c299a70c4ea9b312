#include "population_float64.h"

#include "map/map_gen.h"
#include "map/population.h"

#include <math.h>
#include <stdbool.h>

// A block's coefficients begin at these columns.
enum { GATED = 2 * BT_ELECTRODES, CONDUCTANCES = 3 * GATED, PAIRS = CONDUCTANCES + BT_ELECTRODES };

static double limited(double value, double low, double high)
{
    return fmin(fmax(value, low), high);
}

static double conductance(double count)
{
    count = limited(count, BT_MAP_COUNT_MIN, BT_MAP_COUNT_MAX);
    return count / (BT_FULL_SCALE_COUNT - count);
}

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
    double u[BT_ELECTRODES], gate[3], force[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        bool known = counts[i] != BT_INVALID_COUNT;
        e_q4[i] = known ? 16 * counts[i] - tare_q4[i] : 0;
        u[i] = known ? conductance(counts[i]) / conductance(tare_q4[i] / 16.0) - 1 : 0;
        u[i] = limited(u[i], -1, BT_MAP_RATIO_MAX);
    }
    bt_likeness likeness = bt_population_likeness(e_q4);
    double share = likeness.share / (double)BT_POPULATION_ALL;
    gates_of(e_q4, gate);
    for (int g = 0; g < 3; g++) {
        double sum[3] = {0, 0, 0};
        for (int i = 0; i < BT_ELECTRODES; i++) {
            add(e_q4[i] / 16.0, coefficient[g * GATED + (e_q4[i] > 0 ? BT_ELECTRODES : 0) + i], sum);
        }
        add(gate[g], sum, force);
    }
    const double (*pair)[3] = coefficient + PAIRS;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double row[3] = {0, 0, 0};
        add(1, coefficient[CONDUCTANCES + i], row);
        for (int j = i; j < BT_ELECTRODES; j++) {
            add(u[j], *pair++, row);
        }
        add(u[i], row, force);
    }
    const double *poc = results;
    double *made = results + 3, *torque = results + 6;
    for (int d = 0; d < 3; d++) {
        double otherwise = share < 1 ? likeness.otherwise_100un[d] / 1e4 : 0;
        made[d] = share * force[d] + (1 - share) * otherwise;
    }
    torque[0] = poc[1] * made[2] - poc[2] * made[1];
}
