#include "restart.h"

#include "os.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#define NAME "BIOTAC_SIM_RESTARTED"

static char **arguments;
static restart_state before;
static bool is_restarted;

void restart_init(char **argv)
{
    const char *text = getenv(NAME);
    int started = 0;
    arguments = argv;
    is_restarted = text != NULL
                   && sscanf(text, "%d,%d,%d,%d,%d,%d,%u,%d,%" SCNu64 ",%" SCNu32, &before.link[0],
                             &before.link[1], &before.flash, &before.tape, &before.control[0],
                             &before.control[1], &before.times, &started, &before.start_ns, &before.written)
                          == 10;
    before.started = started != 0;
}

const restart_state *restarted(void)
{
    return is_restarted ? &before : NULL;
}

void restart_process(const restart_state *state)
{
    char text[160];
    (void)snprintf(text, sizeof text, "%d,%d,%d,%d,%d,%d,%u,%d,%" PRIu64 ",%" PRIu32, state->link[0],
                   state->link[1], state->flash, state->tape, state->control[0], state->control[1],
                   before.times + 1, state->started, state->start_ns, state->written);
    os_restart(NAME, text, arguments);
}
