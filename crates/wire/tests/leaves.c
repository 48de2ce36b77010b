/* Subscribes, once it has been let go where there is a second argument, and says what comes until the connection ends. */
#define _DEFAULT_SOURCE
#include "taxel_reader.h"

#include <stdio.h>

int main(int argc, char **argv)
{
    static uint8_t packet[TAXEL_MAX_MESSAGE];
    struct taxel_message message;
    enum taxel_result result;
    struct pollfd end;
    end.fd = argc >= 2 ? taxel_connect(argv[1]) : -1;
    end.events = 0;
    if (end.fd < 0 || (argc == 3 && poll(&end, 1, 20000) != 1))
        return 1;
    if (taxel_subscribe(end.fd, "{\"raw\": true}") != TAXEL_OK)
        return 2;
    puts("subscribed");
    fflush(stdout);
    while ((result = taxel_receive(end.fd, packet, sizeof packet, 20000, &message)) == TAXEL_OK)
        printf("%d %.*s\n", message.type, (int)message.payload_len, (const char *)message.payload);
    puts(taxel_result_name(result));
    close(end.fd);
    return 0;
}
