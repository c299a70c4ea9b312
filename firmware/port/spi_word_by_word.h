// port_spi_slot_begin and port_spi_slot_end for ports whose core does it word by word. Include in one file.
#ifndef BIOTAC_SPI_WORD_BY_WORD_H
#define BIOTAC_SPI_WORD_BY_WORD_H

#include "port.h"

uint32_t port_spi_slot_begin(bt_port *port, uint16_t command, uint8_t mask)
{
    (void)port, (void)command, (void)mask;
    return 0;
}

bool port_spi_slot_end(bt_port *port, uint16_t *word)
{
    (void)port, (void)word;
    return true;
}

#endif
