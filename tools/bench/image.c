// The image counted on the emulated boards: each kernel over the same frames, the shipped one once per scene,
// and whole frames beside them. BENCH_FRAMES per weighting, given by the build.
#include "kernels.h"
#include "mark.h"
#include "scenes.h"

static const struct {
    const char *name;
    uint32_t wanted;
    int32_t scale;
} asked[] = {
    {"everything", BT_WANT_ALL, 1},
    {"everything, doubled", BT_WANT_ALL, 2}, // the ADC's whole range: where a kernel may need longer
    {"PoC only", BT_WANT_POC, 1},
    {"force only", BT_WANT_FORCE, 1},
    {"torque only", BT_WANT_TORQUE, 1},
};

// A sink, so that the compiler drops no result.
static kernel_output output;
static volatile bool has_poc;

__attribute__((noipa)) static bool nothing(const int32_t e_q4[BT_ELECTRODES], const kernel_settings *settings,
                                           uint32_t wanted, kernel_output *out)
{
    (void)e_q4;
    (void)settings;
    (void)out;
    return wanted != 0;
}

static void next_frame(uint32_t *seed, int32_t e_q4[BT_ELECTRODES])
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        *seed = *seed * 1664525u + 1013904223u;
        // A quarter bulges a little, the rest is compressed by up to 2000 counts.
        int32_t size = (int32_t)(*seed >> 17);
        e_q4[i] = *seed & 0xC000 ? -size : size / 8;
    }
}

static void count(const char *name, const char *scene, kernel_run *run, uint32_t wanted,
                  const kernel_settings *settings, const int32_t e_q4[BT_ELECTRODES])
{
    bench_name(name, scene);
    bench_mark();
    has_poc = run(e_q4, settings, wanted, &output);
    bench_mark();
}

static void one_frame(const int32_t e_q4[BT_ELECTRODES], const kernel_settings *settings)
{
    count("nothing", "", nothing, BT_WANT_ALL, settings, e_q4);
    for (int k = 0; k < KERNELS; k++) {
        for (size_t s = 0; s < (k == KERNEL_SHIPPED ? sizeof asked / sizeof *asked : 2); s++) {
            int32_t scaled_q4[BT_ELECTRODES];
            for (int i = 0; i < BT_ELECTRODES; i++) {
                scaled_q4[i] = asked[s].scale * e_q4[i];
            }
            count(kernels[k].name, asked[s].name, kernels[k].run, asked[s].wanted, settings, scaled_q4);
        }
    }
    bt_solve_settings by_default = settings->shipped;
    by_default.population = true; // as on a board that nobody calibrated
    for (const bench_scene *scene = bench_scenes; scene->kernel != NULL; scene++) {
        bench_name(scene->kernel, scene->name);
        bench_mark();
        scene->run(&by_default);
        bench_mark();
    }
}

int main(void)
{
    bench_scenes_init();
    for (int weights = 0; weights <= 2; weights++) {
        static kernel_settings settings;
        kernel_settings_init(&settings, weights);
        uint32_t seed = 1;
        for (int k = 0; k < BENCH_FRAMES; k++) {
            int32_t e_q4[BT_ELECTRODES];
            next_frame(&seed, e_q4);
            one_frame(e_q4, &settings);
        }
    }
    bench_end();
    return 0;
}
