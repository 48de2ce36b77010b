/*
 * taxel_reader.h - reads the messages that taxeld sends to display drivers.
 *
 * One file to copy, however long. C99, no allocation, no dependencies beyond the C library. The format is specified in
 * docs/wire.md. The decoder accepts any bytes: it never reads outside them, and pointers it hands out point
 * into the caller's buffer, which has to live as long as they are used.
 *
 *     uint8_t packet[65536];
 *     struct taxel_message message;
 *     struct taxel_image image;
 *     int fd = taxel_connect("/run/taxeld/images.sock");
 *     while (taxel_receive(fd, packet, sizeof packet, 500, &message) == TAXEL_OK)
 *         if (message.type == TAXEL_IMAGE && taxel_decode_image(packet, message.len, &image) == TAXEL_OK)
 *             show(&image);
 *
 * On systems other than Linux the decoder alone is there; feed it bytes from a stream with taxel_decode.
 *
 * SPDX-License-Identifier: Apache-2.0 OR MIT
 */
#ifndef TAXEL_READER_H
#define TAXEL_READER_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define TAXEL_MAJOR 1
#define TAXEL_MINOR 1
#define TAXEL_HEADER_LEN 40
#define TAXEL_MAX_MESSAGE 409600  /* bytes, header included */
#define TAXEL_MAX_SUBSCRIBE 32768 /* bytes, header included: the most a client may send */

/* What a message is about: taxel_message.type. Skip the types you do not know. */
enum taxel_type {
    TAXEL_HELLO = 1,     /* text, JSON */
    TAXEL_IMAGE = 2,     /* taxel_decode_image */
    TAXEL_STATUS = 3,    /* text, JSON; only where subscribed */
    TAXEL_EVENT = 4,     /* text, JSON */
    TAXEL_RAW = 5,       /* taxel_decode_raw; only where subscribed */
    TAXEL_TOUCH = 6,     /* text, JSON: a completed touch; from programs beside the daemon */
    TAXEL_ESTIMATE = 7,  /* text, JSON: where on the forearm; from programs beside the daemon */
    TAXEL_SUBSCRIBE = 16 /* client to daemon: text, JSON */
};

/* Bits of taxel_message.flags. Ignore the bits you do not know. */
enum taxel_flag {
    TAXEL_FLAG_MISSING = 1 << 0,     /* a taxel's value is missing or stale */
    TAXEL_FLAG_FAULTY = 1 << 1,      /* a taxel is not used because of another fault */
    TAXEL_FLAG_CALIBRATING = 1 << 2, /* the baseline is being measured; the image is empty */
    TAXEL_FLAG_REPAIRED = 1 << 3,    /* a value was repaired in this frame */
    TAXEL_FLAG_GAP = 1 << 4,         /* this reader was not given some messages: see skipped */
    TAXEL_FLAG_SATURATED = 1 << 5,   /* a usable taxel reads an end of its range */
    TAXEL_FLAG_MORE = 1 << 15        /* the text goes on in the next message */
};

/* Bits of taxel_raw.sections: what comes behind the joint angles. Ignore the bits you do not know. */
enum taxel_raw_section {
    TAXEL_RAW_JOINT_AGES = 1 << 0,       /* taxel_raw_joint_age_us */
    TAXEL_RAW_JOINT_VELOCITIES = 1 << 1, /* taxel_raw_joint_velocity */
    TAXEL_RAW_JOINT_CURRENTS = 1 << 2,   /* taxel_raw_joint_current */
    TAXEL_RAW_BASELINES = 1 << 3         /* taxel_raw_baseline */
};

/* What a call has to say. Everything from TAXEL_SHORT_HEADER on is about the bytes. */
enum taxel_result {
    TAXEL_OK = 0,
    TAXEL_TIMEOUT,       /* nothing came in time */
    TAXEL_CLOSED,        /* the daemon closed the connection */
    TAXEL_SOCKET,        /* the connection failed; errno says how */
    TAXEL_WRONG_TYPE,    /* a message of another type than asked for */
    TAXEL_SHORT_HEADER,  /* fewer bytes than a header; on a stream, wait for more */
    TAXEL_BAD_MAGIC,     /* does not start with TCT1 */
    TAXEL_MAJOR_VERSION, /* another major version of the format */
    TAXEL_BAD_HEADER_LEN,/* header_len below 40 */
    TAXEL_TOO_LONG,      /* above TAXEL_MAX_MESSAGE */
    TAXEL_TRUNCATED,     /* fewer bytes than announced; on a stream, wait for more */
    TAXEL_TRAILING,      /* bytes behind the message in its packet */
    TAXEL_FIXED_LEN,     /* fixed_len or record_len too small or not a multiple of 4 */
    TAXEL_SECTION_SHORT, /* the payload is too short for its sections */
    TAXEL_BAD_FORCE,     /* a force that is negative or not finite */
    TAXEL_BAD_ACTUATOR   /* an actuator outside the image or the codebook */
};

/* Header of a message, and its payload. */
struct taxel_message {
    uint8_t major, minor;
    uint16_t header_len;    /* bytes */
    uint16_t type;          /* enum taxel_type, or one of a later version */
    uint16_t flags;         /* enum taxel_flag */
    uint32_t skipped;       /* messages of this type this reader was not given since its last one, or first asked */
    uint64_t seq;           /* number of the tactile frame */
    uint64_t t_ns;          /* time of validity, nanoseconds on the clock that HELLO names */
    const uint8_t *payload; /* in the caller's buffer; text is not terminated by a zero */
    size_t payload_len;     /* bytes */
    size_t len;             /* bytes of the whole message */
};

/* A tactile image. The counts of entries bound the accessors below. */
struct taxel_image {
    uint16_t width, height;              /* pixels */
    uint16_t levels, actuators, joints;  /* numbers of entries */
    uint32_t contacts, faulty, missing;  /* numbers of taxels */
    const uint8_t *pixels;               /* height x width greys, row by row from the top left; 0: no contact */
    const uint8_t *level_bytes, *actuator_bytes, *joint_bytes; /* for the accessors */
};

/* One actuator that presses. */
struct taxel_actuator {
    uint16_t id;    /* below the number of actuators that HELLO names */
    uint16_t x, y;  /* column and row, inside the image */
    uint16_t level; /* 1 to taxel_image.levels */
    float force;    /* force of that level, HELLO's unit; finite, not negative */
};

/* Raw counts of every taxel. */
struct taxel_raw {
    uint32_t taxels;   /* number of entries */
    uint16_t joints;   /* number of entries */
    float threshold;   /* contact threshold, HELLO's unit of force */
    uint32_t sections; /* enum taxel_raw_section: what else there is */
    size_t record_len; /* for the accessors; a section that is not there is a null pointer */
    const uint8_t *record_bytes, *joint_bytes, *age_bytes, *velocity_bytes, *current_bytes, *baseline_bytes;
};

/* One taxel of a RAW message. */
struct taxel_raw_taxel {
    uint16_t counts[3];       /* x, y, z */
    uint16_t faults;          /* bits: why the taxel is not used; 0 where it is */
    float force;              /* above baseline, HELLO's unit */
    uint32_t age_us;          /* microseconds; UINT32_MAX where missing */
    uint8_t freshness;        /* 0 missing, 1 stale, 2 of this frame */
    uint8_t status;           /* the board's status byte */
    uint8_t contact, repaired; /* 0 or 1 */
};

/* ---- fields at any alignment, on any machine -------------------------------------------------------- */

static inline uint16_t taxel_u16(const uint8_t *p)
{
    return (uint16_t)(p[0] | (unsigned)p[1] << 8);
}

static inline uint32_t taxel_u32(const uint8_t *p)
{
    return (uint32_t)taxel_u16(p) | (uint32_t)taxel_u16(p + 2) << 16;
}

static inline uint64_t taxel_u64(const uint8_t *p)
{
    return (uint64_t)taxel_u32(p) | (uint64_t)taxel_u32(p + 4) << 32;
}

static inline float taxel_f32(const uint8_t *p)
{
    uint32_t bits = taxel_u32(p);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline float taxel_nan(void)
{
    static const uint8_t bytes[4] = {0, 0, 0xc0, 0x7f};
    return taxel_f32(bytes);
}

/* Finite and not negative, told from the bits so that no compiler option changes it. Minus zero passes. */
static inline int taxel_is_force(const uint8_t *p)
{
    uint32_t bits = taxel_u32(p);
    return (bits & 0x7f800000u) != 0x7f800000u && (!(bits >> 31) || bits == 0x80000000u);
}

/* ---- messages --------------------------------------------------------------------------------------- */

/*
 * Decodes the message at the start of len bytes, as on a stream; message->len tells where the next starts.
 * TAXEL_SHORT_HEADER and TAXEL_TRUNCATED mean: not all of it is there yet. The payload is not looked at.
 */
static inline enum taxel_result taxel_decode(const uint8_t *bytes, size_t len, struct taxel_message *message)
{
    uint32_t payload_len;
    memset(message, 0, sizeof *message);
    if (len < TAXEL_HEADER_LEN)
        return TAXEL_SHORT_HEADER;
    if (memcmp(bytes, "TCT1", 4) != 0)
        return TAXEL_BAD_MAGIC;
    message->major = bytes[4];
    message->minor = bytes[5];
    if (message->major != TAXEL_MAJOR)
        return TAXEL_MAJOR_VERSION;
    message->header_len = taxel_u16(bytes + 6);
    if (message->header_len < TAXEL_HEADER_LEN)
        return TAXEL_BAD_HEADER_LEN;
    payload_len = taxel_u32(bytes + 12);
    if (payload_len > TAXEL_MAX_MESSAGE || message->header_len + payload_len > TAXEL_MAX_MESSAGE)
        return TAXEL_TOO_LONG;
    message->type = taxel_u16(bytes + 8);
    message->flags = taxel_u16(bytes + 10);
    message->seq = taxel_u64(bytes + 16);
    message->t_ns = taxel_u64(bytes + 24);
    message->skipped = taxel_u32(bytes + 32);
    message->payload_len = payload_len;
    message->len = message->header_len + payload_len;
    if (len < message->len)
        return TAXEL_TRUNCATED;
    message->payload = bytes + message->header_len;
    return TAXEL_OK;
}

/* Decodes a packet of len bytes, which holds exactly one message. */
static inline enum taxel_result taxel_decode_packet(const uint8_t *bytes, size_t len,
                                                    struct taxel_message *message)
{
    enum taxel_result result = taxel_decode(bytes, len, message);
    if (result == TAXEL_OK && len > message->len)
        return TAXEL_TRAILING;
    return result;
}

/* How long after its time of validity a message is looked at, given the time on the clock HELLO names. */
static inline int64_t taxel_latency_ns(const struct taxel_message *message, uint64_t now_ns)
{
    return now_ns >= message->t_ns ? (int64_t)((now_ns - message->t_ns) & INT64_MAX)
                                   : -(int64_t)((message->t_ns - now_ns) & INT64_MAX);
}

/* ---- images ----------------------------------------------------------------------------------------- */

/* The force of level index (from 0), or 0 where there is none. */
static inline float taxel_image_level(const struct taxel_image *image, size_t index)
{
    return index < image->levels ? taxel_f32(image->level_bytes + 4 * index) : 0.0f;
}

/* Joint angle index (from 0) in radians, or 0 where there is none; not a number where it could not be read. */
static inline float taxel_image_joint(const struct taxel_image *image, size_t index)
{
    return index < image->joints ? taxel_f32(image->joint_bytes + 4 * index) : 0.0f;
}

/* The grey of a pixel, 0 to 255; 0 outside the image. */
static inline uint8_t taxel_image_pixel(const struct taxel_image *image, unsigned x, unsigned y)
{
    return x < image->width && y < image->height ? image->pixels[(size_t)y * image->width + x] : 0;
}

/* Actuator index (from 0); returns 0, and leaves *actuator alone, where there is none. */
static inline int taxel_image_actuator(const struct taxel_image *image, size_t index,
                                       struct taxel_actuator *actuator)
{
    const uint8_t *p;
    if (index >= image->actuators)
        return 0;
    p = image->actuator_bytes + 12 * index;
    actuator->id = taxel_u16(p);
    actuator->x = taxel_u16(p + 2);
    actuator->y = taxel_u16(p + 4);
    actuator->level = taxel_u16(p + 6);
    actuator->force = taxel_f32(p + 8);
    return 1;
}

/* Decodes an IMAGE payload. */
static inline enum taxel_result taxel_decode_image_payload(const uint8_t *payload, size_t len,
                                                           struct taxel_image *image)
{
    uint64_t needed;
    uint16_t fixed_len;
    size_t i;
    struct taxel_actuator actuator;
    memset(image, 0, sizeof *image);
    if (len < 24)
        return TAXEL_SECTION_SHORT;
    fixed_len = taxel_u16(payload + 10);
    if (fixed_len < 24 || fixed_len % 4 != 0)
        return TAXEL_FIXED_LEN;
    image->width = taxel_u16(payload);
    image->height = taxel_u16(payload + 2);
    image->levels = taxel_u16(payload + 4);
    image->actuators = taxel_u16(payload + 6);
    image->joints = taxel_u16(payload + 8);
    image->contacts = taxel_u32(payload + 12);
    image->faulty = taxel_u32(payload + 16);
    image->missing = taxel_u32(payload + 20);
    needed = (uint64_t)fixed_len + 4u * (uint64_t)image->levels + 12u * (uint64_t)image->actuators +
             4u * (uint64_t)image->joints + (uint64_t)image->width * image->height;
    if (needed > len) {
        memset(image, 0, sizeof *image);
        return TAXEL_SECTION_SHORT;
    }
    image->level_bytes = payload + fixed_len;
    image->actuator_bytes = image->level_bytes + 4 * (size_t)image->levels;
    image->joint_bytes = image->actuator_bytes + 12 * (size_t)image->actuators;
    image->pixels = image->joint_bytes + 4 * (size_t)image->joints;
    for (i = 0; i < image->levels; i++)
        if (!taxel_is_force(image->level_bytes + 4 * i))
            return TAXEL_BAD_FORCE;
    for (i = 0; taxel_image_actuator(image, i, &actuator); i++) {
        if (actuator.x >= image->width || actuator.y >= image->height || actuator.level < 1 ||
            actuator.level > image->levels)
            return TAXEL_BAD_ACTUATOR;
        if (!taxel_is_force(image->actuator_bytes + 12 * i + 8))
            return TAXEL_BAD_FORCE;
    }
    return TAXEL_OK;
}

/* Decodes a packet that holds an IMAGE message. Use *image only after TAXEL_OK. */
static inline enum taxel_result taxel_decode_image(const uint8_t *packet, size_t len, struct taxel_image *image)
{
    struct taxel_message message;
    enum taxel_result result = taxel_decode_packet(packet, len, &message);
    if (result != TAXEL_OK)
        return result;
    if (message.type != TAXEL_IMAGE)
        return TAXEL_WRONG_TYPE;
    return taxel_decode_image_payload(message.payload, message.payload_len, image);
}

/* ---- raw counts ------------------------------------------------------------------------------------- */

/* The len bytes at *at, if that section is there, and *at moved behind them. */
static inline const uint8_t *taxel_take_section(const uint8_t **at, size_t len, uint32_t is_there)
{
    const uint8_t *section = *at;
    if (!is_there)
        return NULL;
    *at += len;
    return section;
}

/* Decodes a RAW payload. */
static inline enum taxel_result taxel_decode_raw_payload(const uint8_t *payload, size_t len,
                                                         struct taxel_raw *raw)
{
    uint64_t records, joints, baselines, needed;
    uint32_t sections, i;
    uint16_t fixed_len, record_len;
    const uint8_t *at;
    memset(raw, 0, sizeof *raw);
    if (len < 16)
        return TAXEL_SECTION_SHORT;
    record_len = taxel_u16(payload + 4);
    fixed_len = taxel_u16(payload + 6);
    if (fixed_len < 16 || fixed_len % 4 != 0 || record_len < 20 || record_len % 4 != 0)
        return TAXEL_FIXED_LEN;
    records = (uint64_t)taxel_u32(payload) * record_len;
    sections = fixed_len >= 20 && len >= 20 ? taxel_u32(payload + 16) & 15u : 0;
    joints = 4u * (uint64_t)taxel_u16(payload + 12);
    baselines = sections & TAXEL_RAW_BASELINES ? 12u * (uint64_t)taxel_u32(payload) : 0;
    needed = fixed_len + records + joints + baselines;
    for (i = TAXEL_RAW_JOINT_AGES; i <= TAXEL_RAW_JOINT_CURRENTS; i <<= 1)
        needed += sections & i ? joints : 0;
    if (needed > len)
        return TAXEL_SECTION_SHORT;
    raw->taxels = taxel_u32(payload);
    raw->joints = taxel_u16(payload + 12);
    raw->threshold = taxel_f32(payload + 8);
    raw->sections = sections;
    raw->record_len = record_len;
    at = payload + fixed_len;
    raw->record_bytes = taxel_take_section(&at, (size_t)records, 1);
    raw->joint_bytes = taxel_take_section(&at, (size_t)joints, 1);
    raw->age_bytes = taxel_take_section(&at, (size_t)joints, sections & TAXEL_RAW_JOINT_AGES);
    raw->velocity_bytes = taxel_take_section(&at, (size_t)joints, sections & TAXEL_RAW_JOINT_VELOCITIES);
    raw->current_bytes = taxel_take_section(&at, (size_t)joints, sections & TAXEL_RAW_JOINT_CURRENTS);
    raw->baseline_bytes = taxel_take_section(&at, (size_t)baselines, sections & TAXEL_RAW_BASELINES);
    return TAXEL_OK;
}

/* Decodes a packet that holds a RAW message. Use *raw only after TAXEL_OK. */
static inline enum taxel_result taxel_decode_raw(const uint8_t *packet, size_t len, struct taxel_raw *raw)
{
    struct taxel_message message;
    enum taxel_result result = taxel_decode_packet(packet, len, &message);
    if (result != TAXEL_OK)
        return result;
    if (message.type != TAXEL_RAW)
        return TAXEL_WRONG_TYPE;
    return taxel_decode_raw_payload(message.payload, message.payload_len, raw);
}

/* The taxel of that number (from 0); returns 0, and leaves *taxel alone, where there is none. */
static inline int taxel_raw_taxel(const struct taxel_raw *raw, size_t index, struct taxel_raw_taxel *taxel)
{
    const uint8_t *p;
    int axis;
    if (index >= raw->taxels)
        return 0;
    p = raw->record_bytes + raw->record_len * index;
    for (axis = 0; axis < 3; axis++)
        taxel->counts[axis] = taxel_u16(p + 2 * axis);
    taxel->faults = taxel_u16(p + 6);
    taxel->force = taxel_f32(p + 8);
    taxel->age_us = taxel_u32(p + 12);
    taxel->freshness = p[16] <= 2 ? p[16] : 0;
    taxel->status = p[17];
    taxel->contact = p[18] & 1;
    taxel->repaired = p[18] >> 1 & 1;
    return 1;
}

/* Joint angle index (from 0) in radians, or 0 where there is none; not a number where it could not be read. */
static inline float taxel_raw_joint(const struct taxel_raw *raw, size_t index)
{
    return index < raw->joints ? taxel_f32(raw->joint_bytes + 4 * index) : 0.0f;
}

/* Time from the frame's to that joint's nearest reading, microseconds; UINT32_MAX where unknown. */
static inline uint32_t taxel_raw_joint_age_us(const struct taxel_raw *raw, size_t index)
{
    return raw->age_bytes && index < raw->joints ? taxel_u32(raw->age_bytes + 4 * index) : UINT32_MAX;
}

/* That joint's angular velocity, radians per second; not a number where unknown. */
static inline float taxel_raw_joint_velocity(const struct taxel_raw *raw, size_t index)
{
    return raw->velocity_bytes && index < raw->joints ? taxel_f32(raw->velocity_bytes + 4 * index) : taxel_nan();
}

/* The present current of that joint's servo, amperes; not a number where unknown. */
static inline float taxel_raw_joint_current(const struct taxel_raw *raw, size_t index)
{
    return raw->current_bytes && index < raw->joints ? taxel_f32(raw->current_bytes + 4 * index) : taxel_nan();
}

/*
 * The value at rest of that taxel, counts x, y, z, for taxel_press; not a number while calibrating, and where
 * unknown. Returns 0, and leaves baseline alone, where the message has none.
 */
static inline int taxel_raw_baseline(const struct taxel_raw *raw, size_t index, float baseline[3])
{
    int axis;
    if (!raw->baseline_bytes || index >= raw->taxels)
        return 0;
    for (axis = 0; axis < 3; axis++)
        baseline[axis] = taxel_f32(raw->baseline_bytes + 12 * index + 4 * axis);
    return 1;
}

/*
 * The signed press on one axis: how far the count is from the baseline, -32768 to 32768, since counts wrap around
 * modulo 65536. Not a number where the baseline is none.
 */
static inline float taxel_press(uint16_t count, float baseline)
{
    double difference = (double)count - (double)baseline;
    if (!(difference > -16777216.0 && difference < 16777216.0))
        return taxel_nan();
    difference += 32768.0;
    difference -= 65536.0 * (int32_t)(difference / 65536.0);
    if (difference < 0)
        difference += 65536.0;
    return (float)(difference - 32768.0);
}

/* ---- the connection --------------------------------------------------------------------------------- */

/* The result in one word. */
static inline const char *taxel_result_name(enum taxel_result result)
{
    switch (result) {
    case TAXEL_OK: return "ok";
    case TAXEL_TIMEOUT: return "timeout";
    case TAXEL_CLOSED: return "closed";
    case TAXEL_SOCKET: return "socket";
    case TAXEL_WRONG_TYPE: return "wrong_type";
    case TAXEL_SHORT_HEADER: return "short_header";
    case TAXEL_BAD_MAGIC: return "bad_magic";
    case TAXEL_MAJOR_VERSION: return "major_version";
    case TAXEL_BAD_HEADER_LEN: return "header_len";
    case TAXEL_TOO_LONG: return "too_long";
    case TAXEL_TRUNCATED: return "truncated";
    case TAXEL_TRAILING: return "trailing";
    case TAXEL_FIXED_LEN: return "fixed_len";
    case TAXEL_SECTION_SHORT: return "section_short";
    case TAXEL_BAD_FORCE: return "bad_force";
    case TAXEL_BAD_ACTUATOR: return "bad_actuator";
    }
    return "unknown";
}

#ifdef __linux__

#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <unistd.h>

/* Whether a socket is in a folder /tmp/taxeld-UID that somebody else than UID owns or may write: it may be anybody's. */
static inline int taxel_in_foreign_folder(const char *path)
{
    static const char start[] = "/tmp/taxeld-";
    const size_t start_len = sizeof start - 1;
    const char *slash = strrchr(path, '/');
    char folder[sizeof ((struct sockaddr_un *)0)->sun_path];
    struct stat found;
    unsigned long uid;
    char *end;
    size_t len = slash ? (size_t)(slash - path) : 0;
    if (len <= start_len || len >= sizeof folder || memcmp(path, start, start_len) != 0)
        return 0;
    memcpy(folder, path, len);
    folder[len] = 0;
    uid = strtoul(folder + start_len, &end, 10);
    if (*end != 0)
        return 0;
#if defined _POSIX_C_SOURCE && _POSIX_C_SOURCE >= 200112L
    if (lstat(folder, &found) != 0)
#else
    if (stat(folder, &found) != 0)
#endif
        return 0;
    return !S_ISDIR(found.st_mode) || (unsigned long)found.st_uid != uid || (found.st_mode & 022) != 0;
}

/*
 * Connects to the daemon's data socket. Returns a descriptor to close(), or -1 with errno: EACCES also where it is in
 * a folder /tmp/taxeld-UID that is not UID's alone, EAGAIN where the daemon takes no connection for five seconds, as one
 * that hangs.
 */
static inline int taxel_connect(const char *path)
{
    const struct timeval patience = {5, 0};
    struct sockaddr_un address;
    int fd, failed, error;
    memset(&address, 0, sizeof address);
    address.sun_family = AF_UNIX;
    if (strlen(path) >= sizeof address.sun_path) {
        errno = ENAMETOOLONG;
        return -1;
    }
    memcpy(address.sun_path, path, strlen(path));
    if (taxel_in_foreign_folder(path)) {
        errno = EACCES;
        return -1;
    }
    fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return -1;
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    do
        failed = connect(fd, (const struct sockaddr *)&address, sizeof address);
    while (failed && errno == EINTR);
    if (failed) {
        error = errno;
        close(fd);
        errno = error;
        return -1;
    }
    return fd;
}

/*
 * Waits at most timeout_ms milliseconds (-1: for ever) for a message and receives it into packet. A signal
 * ends the wait with TAXEL_TIMEOUT. A message longer than the buffer is TAXEL_TRUNCATED; the next one can be
 * read all the same, so a driver that wants no HELLO needs no buffer for one.
 */
static inline enum taxel_result taxel_receive(int fd, uint8_t *packet, size_t size, int timeout_ms,
                                              struct taxel_message *message)
{
    struct pollfd wait;
    ssize_t len;
    int ready;
    memset(message, 0, sizeof *message);
    wait.fd = fd;
    wait.events = POLLIN;
    wait.revents = 0;
    ready = poll(&wait, 1, timeout_ms);
    if (ready == 0 || (ready < 0 && errno == EINTR))
        return TAXEL_TIMEOUT;
    if (ready < 0)
        return TAXEL_SOCKET;
    len = recv(fd, packet, size, 0);
    /* The daemon left with our subscription unread; what it said before can be read still. */
    if (len < 0 && errno == ECONNRESET)
        len = recv(fd, packet, size, 0);
    if (len < 0 && errno == EINTR)
        return TAXEL_TIMEOUT;
    if (len < 0)
        return TAXEL_SOCKET;
    if (len == 0)
        return TAXEL_CLOSED;
    return taxel_decode_packet(packet, (size_t)len, message);
}

/*
 * Tells the daemon what to send, as JSON such as {"raw": true}. Needed only for more or less than the images of
 * the daemon's own profile. A display states what it can do like this:
 *
 *     taxel_subscribe(fd, "{\"profile\": {\"levels\": 4, \"actuators\": 5}, \"region\": [\"index\", \"thumb\"]}");
 *
 * The answer is a HELLO, after which the images are as asked for, or an EVENT that says why not. A recorder that wants
 * every raw frame in order, not the newest: "{\"image\": false, \"raw\": true, \"every\": true}".
 *
 * TAXEL_OK also where the daemon lets this client go: taxel_receive() then has the EVENT that says why, and TAXEL_CLOSED.
 */
static inline enum taxel_result taxel_subscribe(int fd, const char *json)
{
    uint8_t header[TAXEL_HEADER_LEN];
    struct iovec parts[2];
    struct msghdr message;
    size_t len = strlen(json);
    ssize_t sent;
    if (len > TAXEL_MAX_SUBSCRIBE - TAXEL_HEADER_LEN)
        return TAXEL_TOO_LONG;
    memset(header, 0, sizeof header);
    memcpy(header, "TCT1", 4);
    header[4] = TAXEL_MAJOR;
    header[5] = TAXEL_MINOR;
    header[6] = TAXEL_HEADER_LEN;
    header[8] = TAXEL_SUBSCRIBE;
    header[12] = (uint8_t)(len & 0xff);
    header[13] = (uint8_t)(len >> 8);
    parts[0].iov_base = header;
    parts[0].iov_len = sizeof header;
    parts[1].iov_base = (void *)json;
    parts[1].iov_len = len;
    memset(&message, 0, sizeof message);
    message.msg_iov = parts;
    message.msg_iovlen = 2;
    do
        sent = sendmsg(fd, &message, MSG_NOSIGNAL);
    while (sent < 0 && errno == EINTR);
    return sent < 0 && errno != EPIPE && errno != ECONNRESET ? TAXEL_SOCKET : TAXEL_OK;
}

#endif /* __linux__ */
#endif /* TAXEL_READER_H */
