#include "gateway.h"
#include "port.h"

static bt_gateway gateway;

bool bt_port_alarm(void)
{
    return bt_gateway_alarm(&gateway);
}

int main(int argc, char **argv)
{
    bt_port *port = port_init(argc, argv);
    bt_gateway_init(&gateway, port);
    for (;;) {
        bt_gateway_poll(&gateway);
        port_idle(port);
    }
}
