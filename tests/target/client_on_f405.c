// host/docs/guides/examples/example_bare.c on the STM32F405 in QEMU, with the UART on a gateway. Prints the
// forces to act on, "finger x y z" in 100 uN, until there are enough, then how many rounds were lost.
#include "only_board.h"
#include "stm32f405.h"

#include "biotac_client.h"
#include "semihosting.h"

#define ENOUGH 100

void hand_poll(void);
uint32_t hand_lost(void);
void uart_send(const uint8_t *data, size_t bytes);
int uart_next(void);
uint32_t now_ms(void);
void act_on(const bt_msg_frame *frame);
void act_on_event(const bt_msg_event *event);

uint32_t flash_erase_us;
static unsigned acted;

void spi_start(void)
{
}

bool bt_port_alarm(void)
{
    return false;
}

void uart_send(const uint8_t *data, size_t bytes)
{
    (void)port_link_write(ONLY_BOARD, 0, data, bytes);
}

int uart_next(void)
{
    uint8_t byte;
    return port_link_read(ONLY_BOARD, 0, &byte, 1) == 1 ? byte : -1;
}

uint32_t now_ms(void)
{
    return port_now_us(ONLY_BOARD) / 1000;
}

void act_on_event(const bt_msg_event *event)
{
    (void)event;
}

void act_on(const bt_msg_frame *frame)
{
    if (!bt_valid_i32(frame->force_100un[2]) || (frame->flags & BT_FRAME_FLAG_FAULT)) {
        return;
    }
    semihost_write_hex(frame->finger);
    for (int axis = 0; axis < 3; axis++) {
        semihost_write(" ");
        semihost_write_hex((uint32_t)frame->force_100un[axis]);
    }
    semihost_write("\n");
    acted++;
}

int main(int argc, char **argv)
{
    bt_port *port = port_init(argc, argv);
    port_link_uart(port, 0);
    for (;;) {
        hand_poll();
        port_idle(port);
        if (acted >= ENOUGH) {
            semihost_write_hex(hand_lost());
            semihost_write(" lost\n");
            (void)semihost(SYS_EXIT, EXIT_DONE);
        }
    }
}
