/* Decodes the packets on standard input, each behind its length as u32, and prints a JSON line per packet. */
#include "taxel_reader.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static void print_float(float value)
{
    if (isfinite(value))
        printf("%.9g", (double)value);
    else
        printf("null");
}

static void print_hex(const char *key, const uint8_t *bytes, size_t len)
{
    size_t i;
    printf(",\"%s\":\"", key);
    for (i = 0; i < len; i++)
        printf("%02x", (unsigned)bytes[i]);
    printf("\"");
}

static void print_joints(const char *key, float (*joint)(const void *, size_t), const void *from, size_t len)
{
    size_t i;
    printf(",\"%s\":[", key);
    for (i = 0; i < len; i++) {
        printf("%s", i ? "," : "");
        print_float(joint(from, i));
    }
    printf("]");
}

static float image_joint(const void *image, size_t i)
{
    return taxel_image_joint(image, i);
}

static float raw_joint(const void *raw, size_t i)
{
    return taxel_raw_joint(raw, i);
}

static float raw_velocity(const void *raw, size_t i)
{
    return taxel_raw_joint_velocity(raw, i);
}

static float raw_current(const void *raw, size_t i)
{
    return taxel_raw_joint_current(raw, i);
}

static void print_header(const struct taxel_message *m)
{
    printf("{\"major\":%u,\"minor\":%u,\"header_len\":%u,\"type\":%u,\"flags\":%u,\"payload_len\":%lu,"
           "\"seq\":%llu,\"t_ns\":%llu,\"skipped\":%lu",
           (unsigned)m->major, (unsigned)m->minor, (unsigned)m->header_len, (unsigned)m->type,
           (unsigned)m->flags, (unsigned long)m->payload_len, (unsigned long long)m->seq,
           (unsigned long long)m->t_ns, (unsigned long)m->skipped);
}

static void print_image(const struct taxel_image *image)
{
    struct taxel_actuator actuator;
    size_t i;
    unsigned x, y;
    printf(",\"width\":%u,\"height\":%u,\"contacts\":%lu,\"faulty\":%lu,\"missing\":%lu,\"levels\":[",
           (unsigned)image->width, (unsigned)image->height, (unsigned long)image->contacts,
           (unsigned long)image->faulty, (unsigned long)image->missing);
    for (i = 0; i < image->levels; i++) {
        printf("%s", i ? "," : "");
        print_float(taxel_image_level(image, i));
    }
    printf("],\"actuators\":[");
    for (i = 0; taxel_image_actuator(image, i, &actuator); i++) {
        printf("%s[%u,%u,%u,%u,", i ? "," : "", (unsigned)actuator.id, (unsigned)actuator.x,
               (unsigned)actuator.y, (unsigned)actuator.level);
        print_float(actuator.force);
        printf("]");
    }
    printf("]");
    print_joints("joints", image_joint, image, image->joints);
    printf(",\"pixels\":\"");
    for (y = 0; y < image->height; y++)
        for (x = 0; x < image->width; x++)
            printf("%02x", (unsigned)taxel_image_pixel(image, x, y));
    printf("\"}\n");
}

/* The baseline of each taxel, or how far its counts are from it. */
static void print_axes(const char *key, const struct taxel_raw *raw, int press)
{
    struct taxel_raw_taxel t;
    float axes[3];
    size_t i;
    int axis;
    printf(",\"%s\":[", key);
    for (i = 0; taxel_raw_baseline(raw, i, axes) && taxel_raw_taxel(raw, i, &t); i++) {
        printf("%s[", i ? "," : "");
        for (axis = 0; axis < 3; axis++) {
            printf("%s", axis ? "," : "");
            print_float(press ? taxel_press(t.counts[axis], axes[axis]) : axes[axis]);
        }
        printf("]");
    }
    printf("]");
}

static void print_sections(const struct taxel_raw *raw)
{
    size_t i;
    if (raw->sections & TAXEL_RAW_JOINT_AGES) {
        printf(",\"joint_ages_us\":[");
        for (i = 0; i < raw->joints; i++)
            printf("%s%lu", i ? "," : "", (unsigned long)taxel_raw_joint_age_us(raw, i));
        printf("]");
    }
    if (raw->sections & TAXEL_RAW_JOINT_VELOCITIES)
        print_joints("joint_velocities", raw_velocity, raw, raw->joints);
    if (raw->sections & TAXEL_RAW_JOINT_CURRENTS)
        print_joints("joint_currents", raw_current, raw, raw->joints);
    if (raw->sections & TAXEL_RAW_BASELINES) {
        print_axes("baselines", raw, 0);
        print_axes("presses", raw, 1);
    }
}

static void print_raw(const struct taxel_raw *raw)
{
    struct taxel_raw_taxel t;
    size_t i;
    printf(",\"threshold\":");
    print_float(raw->threshold);
    print_joints("joints", raw_joint, raw, raw->joints);
    printf(",\"taxels\":[");
    for (i = 0; taxel_raw_taxel(raw, i, &t); i++) {
        printf("%s{\"counts\":[%u,%u,%u],\"faults\":%u,\"force\":", i ? "," : "", (unsigned)t.counts[0],
               (unsigned)t.counts[1], (unsigned)t.counts[2], (unsigned)t.faults);
        print_float(t.force);
        printf(",\"age_us\":%lu,\"freshness\":%u,\"status\":%u,\"contact\":%u,\"repaired\":%u}",
               (unsigned long)t.age_us, (unsigned)t.freshness, (unsigned)t.status, (unsigned)t.contact,
               (unsigned)t.repaired);
    }
    printf("]");
    print_sections(raw);
    printf("}\n");
}

static void dump(const uint8_t *packet, size_t len)
{
    struct taxel_message message;
    struct taxel_image image;
    struct taxel_raw raw;
    enum taxel_result result = taxel_decode_packet(packet, len, &message);
    if (result == TAXEL_OK && message.type == TAXEL_IMAGE)
        result = taxel_decode_image(packet, len, &image);
    if (result == TAXEL_OK && message.type == TAXEL_RAW)
        result = taxel_decode_raw(packet, len, &raw);
    if (result != TAXEL_OK) {
        printf("{\"error\":\"%s\"}\n", taxel_result_name(result));
        return;
    }
    print_header(&message);
    if (message.type == TAXEL_IMAGE) {
        print_image(&image);
    } else if (message.type == TAXEL_RAW) {
        print_raw(&raw);
    } else {
        print_hex("payload", message.payload, message.payload_len);
        printf("}\n");
    }
}

int main(void)
{
    uint8_t prefix[4];
    while (fread(prefix, 1, 4, stdin) == 4) {
        size_t len = taxel_u32(prefix);
        /* Exactly as long as the packet, so that the address sanitizer sees a read beyond it. */
        uint8_t *packet = malloc(len ? len : 1);
        if (!packet || fread(packet, 1, len, stdin) != len)
            return 1;
        dump(packet, len);
        free(packet);
    }
    return 0;
}
