// A reset of the simulated board: the process runs itself anew, and hands over what outlives a board.
#ifndef BIOTAC_POSIX_RESTART_H
#define BIOTAC_POSIX_RESTART_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    int link[2], flash, tape, control[2]; // open files, by their numbers (os.h), -1: none
    unsigned times;                       // it has been reset
    bool started;
    uint64_t start_ns; // of the sensors' first slot, by the new board's clock
    uint32_t written;  // slots of the tape
} restart_state;

// Remember how the process was started, and what the one before has left.
void restart_init(char **argv);

// What the board before the reset has left; NULL: this is the first.
const restart_state *restarted(void);

// Returns only if it can't, with errno set.
void restart_process(const restart_state *state);

#endif
