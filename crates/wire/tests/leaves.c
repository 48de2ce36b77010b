/* Subscribes, and says how the connection ends. */
#define _DEFAULT_SOURCE
#include "taxel_reader.h"

#include <stdio.h>

int main(int argc, char **argv)
{
    static uint8_t packet[TAXEL_MAX_MESSAGE];
    struct taxel_message message;
    int fd = argc == 2 ? taxel_connect(argv[1]) : -1;
    if (fd < 0 || taxel_subscribe(fd, "{\"raw\": true}") != TAXEL_OK)
        return 1;
    puts("subscribed");
    fflush(stdout);
    puts(taxel_result_name(taxel_receive(fd, packet, sizeof packet, 20000, &message)));
    close(fd);
    return 0;
}
