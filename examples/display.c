/*
 * A display driver in C: presses actuators as the tactile images say.
 *
 *     cc -std=c99 -O2 -I crates/wire/c examples/display.c -o display
 *     ./display /run/taxeld/images.sock
 *
 * Put your hardware into drive(), which is called with the levels of all actuators, 0 to LEVELS, whenever they
 * change. The display states how many it has: without that a level is one of the daemon's, whose number may change.
 * When no image has come for DEAD_MAN_MS everything is let go: a display must not press on what the hand no longer
 * feels. When the daemon goes away the driver lets go at once and connects again.
 *
 * SPDX-License-Identifier: Apache-2.0 OR MIT
 */
#define _POSIX_C_SOURCE 200809L
#include "taxel_reader.h"

#include <signal.h>
#include <stdio.h>
#include <time.h>

#define LEVELS 8         /* of force, and actuators, of your display */
#define ACTUATORS 16     /* ids above are not there and are counted as not shown */
#define DEAD_MAN_MS 200  /* a few image periods; at 30 Hz an image comes every 33 ms */
#define RECONNECT_MS 500

static volatile sig_atomic_t stop;

static void on_signal(int signal)
{
    (void)signal;
    stop = 1;
}

/* Your hardware: sets every actuator to its level, 0 for let go. */
static void drive(const uint16_t levels[ACTUATORS], const char *why)
{
    int id, pressed = 0;
    printf("%s:", why);
    for (id = 0; id < ACTUATORS; id++)
        if (levels[id]) {
            printf(" %d=%u", id, (unsigned)levels[id]);
            pressed++;
        }
    printf("%s\n", pressed ? "" : " clear");
    fflush(stdout);
}

static void let_go(uint16_t levels[ACTUATORS], const char *why)
{
    memset(levels, 0, ACTUATORS * sizeof *levels);
    drive(levels, why);
}

static void show(const struct taxel_message *message, const struct taxel_image *image,
                 uint16_t levels[ACTUATORS])
{
    uint16_t next[ACTUATORS] = {0};
    struct taxel_actuator actuator;
    size_t i, not_shown = 0;
    for (i = 0; taxel_image_actuator(image, i, &actuator); i++) {
        if (actuator.id < ACTUATORS)
            /* The first image may be from before the daemon has heard of LEVELS. */
            next[actuator.id] = actuator.level < LEVELS ? actuator.level : LEVELS;
        else
            not_shown++;
    }
    if (not_shown)
        fprintf(stderr, "display: %lu actuators of image %llu are not on this display\n",
                (unsigned long)not_shown, (unsigned long long)message->seq);
    if (memcmp(next, levels, sizeof next) != 0) {
        memcpy(levels, next, sizeof next);
        drive(levels, "image");
    }
}

/* Whether an event says that the daemon cannot give such images. */
static int is_refusal(const struct taxel_message *event)
{
    static const char refused[] = "\"refused\"";
    const size_t length = sizeof refused - 1;
    size_t i;
    for (i = 0; i + length <= event->payload_len; i++)
        if (memcmp(event->payload + i, refused, length) == 0)
            return 1;
    return 0;
}

/* Shows images until the connection ends, or the daemon refuses to make them: its own, which it goes on to send, are
 * not of this display. */
static enum taxel_result follow(int fd, uint16_t levels[ACTUATORS], int *refused)
{
    static uint8_t packet[TAXEL_MAX_MESSAGE];
    struct taxel_message message;
    struct taxel_image image;
    struct timespec last, now;
    char profile[64];
    enum taxel_result asked;
    snprintf(profile, sizeof profile, "{\"profile\": {\"levels\": %d, \"actuators\": %d}}", LEVELS, ACTUATORS);
    asked = taxel_subscribe(fd, profile);
    if (asked != TAXEL_OK)
        return asked;
    clock_gettime(CLOCK_MONOTONIC, &last);
    while (!stop) {
        enum taxel_result result = taxel_receive(fd, packet, sizeof packet, 20, &message);
        clock_gettime(CLOCK_MONOTONIC, &now);
        if (result == TAXEL_CLOSED || result == TAXEL_SOCKET || result == TAXEL_MAJOR_VERSION)
            return result;
        if (result == TAXEL_OK && message.type == TAXEL_IMAGE)
            result = taxel_decode_image(packet, message.len, &image);
        if (result == TAXEL_OK && message.type == TAXEL_IMAGE) {
            show(&message, &image, levels);
            last = now;
        } else if (result == TAXEL_OK && message.type == TAXEL_EVENT) {
            fprintf(stderr, "taxeld: %.*s\n", (int)message.payload_len, (const char *)message.payload);
            if (is_refusal(&message)) {
                *refused = 1;
                return TAXEL_OK;
            }
        } else if (result != TAXEL_OK && result != TAXEL_TIMEOUT) {
            fprintf(stderr, "display: a message was not usable: %s\n", taxel_result_name(result));
        }
        /* Not by the time-out alone: messages that are not images must not hold the display. */
        if ((now.tv_sec - last.tv_sec) * 1000 + (now.tv_nsec - last.tv_nsec) / 1000000 >= DEAD_MAN_MS) {
            size_t id;
            for (id = 0; id < ACTUATORS && !levels[id]; id++)
                ;
            if (id < ACTUATORS)
                let_go(levels, "no image");
        }
    }
    return TAXEL_OK;
}

int main(int argc, char **argv)
{
    uint16_t levels[ACTUATORS] = {0};
    const struct timespec pause = {RECONNECT_MS / 1000, RECONNECT_MS % 1000 * 1000000L};
    struct sigaction action;
    if (argc != 2) {
        fprintf(stderr, "usage: %s SOCKET, such as /run/taxeld/images.sock; taxeld logs where it is\n", argv[0]);
        return 2;
    }
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGHUP, &action, NULL); /* its terminal was closed */
    sigaction(SIGQUIT, &action, NULL);
    while (!stop) {
        int fd = taxel_connect(argv[1]);
        if (fd < 0) {
            perror(argv[1]);
        } else {
            int refused = 0;
            enum taxel_result result = follow(fd, levels, &refused);
            close(fd);
            let_go(levels, stop ? "stopped" : refused ? "refused" : taxel_result_name(result));
            if (refused)
                return 1;
            if (result == TAXEL_MAJOR_VERSION) {
                fprintf(stderr, "display: taxeld speaks another version; update this driver\n");
                return 1;
            }
        }
        if (!stop)
            nanosleep(&pause, NULL);
    }
    return 0;
}
