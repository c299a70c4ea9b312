// A fuzz target without a fuzzer, for any compiler: it gets the files named, and each with one
// bit turned at a time, at places spread over it. An input that it finds wrong ends the process, as under a
// fuzzer.
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define MAX_BYTES 32768
#define TURNS     256

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int main(int argc, char **argv)
{
    static uint8_t whole[MAX_BYTES];
    for (int k = 1; k < argc; k++) {
        FILE *file = fopen(argv[k], "rb");
        size_t size = file == NULL ? 0 : fread(whole, 1, sizeof whole, file);
        if (file == NULL || fclose(file) != 0) {
            fprintf(stderr, "%s cannot be read\n", argv[k]);
            return 1;
        }
        fprintf(stderr, "\r%s", argv[k]);
        (void)LLVMFuzzerTestOneInput(whole, size);
        for (size_t turn = 0; turn < TURNS && size > 0; turn++) {
            size_t bit = (turn * 8 * size) / TURNS + turn % 8;
            whole[bit / 8 % size] ^= (uint8_t)(1u << bit % 8);
            (void)LLVMFuzzerTestOneInput(whole, size);
            whole[bit / 8 % size] ^= (uint8_t)(1u << bit % 8);
        }
    }
    fprintf(stderr, "\r%d files\n", argc - 1);
    return 0;
}
