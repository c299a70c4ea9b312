#include "answers.h"
#include "commands.h"
#include "loop.h"
#include "only_board.h"
#include "system.h"

static bt_emu_stream stream;

void bus_start(void)
{
    answers_start(&stream);
}

int main(int argc, char **argv)
{
    (void)port_init(argc, argv);
    commands_start(&stream);
    for (;;) {
        commands_poll();
        loop_poll();
        port_idle(ONLY_BOARD);
    }
}
