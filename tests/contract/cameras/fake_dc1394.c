/* A stand-in for libdc1394 2.2, for tests: two cameras, and status codes as the real one gives.

   Camera 1 has format 7, absolute shutter and gain, and triggers; camera 2 has fixed modes only,
   and a shutter in counts. Frames come by a timer, whose file the caller polls as it would poll
   the kernel's. Pixels count up from the number of the frame. The layout of the structures is
   that of the headers of libdc1394 2.2.6. */

#define _GNU_SOURCE
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

enum { SUCCESS = 0, FAILURE = -1, NOT_SUPPORTED = -3, NO_BANDWIDTH = -8, IOCTL_FAILURE = -9,
       CAPTURE_NOT_SET = -10, CAPTURE_RUNNING = -11, INVALID_VALUE = -15, OUTSIDE_RANGE = -16,
       INVALID_FEATURE = -17, INVALID_MODE = -19, INVALID_FRAMERATE = -20 };
enum { MONO8 = 352, MONO16 = 357, FORMAT7_0 = 88, MODE_640_MONO8 = 69, MODE_1024_MONO8 = 76,
       MODE_1024_MONO16 = 78, SHUTTER = 423, GAIN = 424, TRIGGER = 428, MANUAL = 736,
       SOFTWARE = 580, POLL = 673, RING = 64 };
#define SENSOR_W 1600
#define SENSOR_H 1200
#define MOST 32768 /* bytes a packet at S3200, so that any size runs at 60 Hz */

typedef struct {
    uint64_t guid; int unit;
    uint32_t spec, sw, sub_sw, base, directory, dependent;
    uint64_t csr[4], format7[8];
    int iidc; char *vendor, *model;
    uint32_t vendor_id, model_id;
    int bmode, one_shot, multi_shot, on_off, vmode_status, feature_status, max_mem;
    uint32_t flags;
} camera_t;
typedef struct { uint16_t unit; uint64_t guid; } id_t1394;
typedef struct { uint32_t num; id_t1394 *ids; } list_t;
typedef struct {
    unsigned char *image; uint32_t size[2], position[2];
    int coding, filter; uint32_t byte_order, depth, stride; int mode;
    uint64_t total_bytes; uint32_t image_bytes, padding, packet, packets;
    uint64_t timestamp; uint32_t behind; camera_t *camera; uint32_t id; uint64_t allocated;
    int little_endian, data_in_padding;
} frame_t;

typedef struct {
    camera_t public;
    int opened, plugged, sending, file, is_event, buffers, bmode_set;
    int mode, coding, framerate, packet, left, top, width, height;
    float shutter, gain; uint32_t shutter_counts; int triggered, source;
    uint64_t sent, waiting; int corrupt, skip;
    frame_t frames[RING];
} state_t;

static state_t state[2] = {
    { .public = { .guid = 0x0800460200000001, .vendor = "SONY", .model = "XCD-U100 (stand-in)",
                  .bmode = 1 },
      .plugged = 1, .file = -1, .mode = FORMAT7_0, .coding = MONO8, .packet = 8192,
      .width = SENSOR_W, .height = SENSOR_H, .shutter = 0.01f, .source = 576 },
    { .public = { .guid = 0x0800460200000002, .vendor = "OLD", .model = "Fixed (stand-in)" },
      .plugged = 1, .file = -1, .mode = MODE_640_MONO8, .coding = MONO8, .framerate = 36,
      .width = 640, .height = 480, .shutter_counts = 100 },
};
static int open_cameras, open_lists;

static state_t *of(camera_t *camera) { return (state_t *)camera; }
#define NEED(c) do { if (!of(c)->plugged) return FAILURE; } while (0)

/* --- what tests do to it ------------------------------------------------------------------- */
void fake_plug(int number, int plugged) {
    state[number].plugged = plugged;
    if (!plugged) state[number].sending = 0;
}
void fake_power_cycle(int number) { state[number].sending = 0; }
void fake_corrupt_next(int number) { state[number].corrupt = 1; }
void fake_skip(int number, int frames) { state[number].skip = frames; }
int fake_left_open(void) { return open_cameras + open_lists; }
int fake_mode(int number) { return state[number].mode; }

/* --- library and cameras ------------------------------------------------------------------- */
void *dc1394_new(void) { return malloc(1); }
void dc1394_free(void *library) { free(library); }
const char *dc1394_error_get_string(int status) {
    return status == IOCTL_FAILURE ? "Video1394 ioctl failure" : status == FAILURE
        ? "Generic failure" : status == NO_BANDWIDTH ? "Not enough bandwidth" : "Some error";
}
int dc1394_camera_enumerate(void *library, list_t **list) {
    (void)library;
    *list = calloc(1, sizeof **list);
    (*list)->ids = calloc(2, sizeof(id_t1394));
    for (int i = 0; i < 2; i++)
        if (state[i].plugged) (*list)->ids[(*list)->num++].guid = state[i].public.guid;
    open_lists++;
    return SUCCESS;
}
void dc1394_camera_free_list(list_t *list) { open_lists--; free(list->ids); free(list); }
camera_t *dc1394_camera_new_unit(void *library, uint64_t guid, int unit) {
    (void)library;
    for (int i = 0; i < 2; i++)
        if (state[i].public.guid == guid && !unit && state[i].plugged) {
            open_cameras++;
            return &state[i].public;
        }
    return NULL;
}
void dc1394_camera_free(camera_t *camera) { (void)camera; open_cameras--; }

/* --- modes --------------------------------------------------------------------------------- */
int dc1394_video_get_supported_modes(camera_t *c, uint32_t *modes) {
    NEED(c);
    int *list = (int *)modes + 1;
    if (of(c) == &state[0]) { modes[0] = 1; list[0] = FORMAT7_0; return SUCCESS; }
    modes[0] = 4; list[0] = MODE_640_MONO8; list[1] = 64; list[2] = MODE_1024_MONO8;
    list[3] = MODE_1024_MONO16;
    return SUCCESS;
}
int dc1394_video_get_supported_framerates(camera_t *c, int mode, uint32_t *rates) {
    NEED(c);
    if (mode == FORMAT7_0) return INVALID_MODE;
    int *list = (int *)rates + 1;
    rates[0] = 3; list[0] = 34; list[1] = 35; list[2] = 36;
    return SUCCESS;
}
int dc1394_video_get_framerate(camera_t *c, int *rate) { NEED(c); *rate = of(c)->framerate; return SUCCESS; }
int dc1394_video_set_framerate(camera_t *c, int rate) {
    NEED(c);
    if (rate < 34 || rate > 36) return INVALID_FRAMERATE;
    of(c)->framerate = rate;
    return SUCCESS;
}
int dc1394_video_get_mode(camera_t *c, int *mode) { NEED(c); *mode = of(c)->mode; return SUCCESS; }
int dc1394_video_set_mode(camera_t *c, int mode) {
    NEED(c);
    state_t *s = of(c);
    s->mode = mode;
    if (mode != FORMAT7_0) {
        s->width = mode == MODE_640_MONO8 ? 640 : 1024;
        s->height = mode == MODE_640_MONO8 ? 480 : 768;
        s->coding = mode == MODE_1024_MONO16 ? MONO16 : MONO8;
    }
    return SUCCESS;
}
int dc1394_video_set_operation_mode(camera_t *c, int mode) {
    NEED(c);
    if (!c->bmode) return NOT_SUPPORTED;
    of(c)->bmode_set = mode == 481;
    return SUCCESS;
}
int dc1394_video_set_iso_speed(camera_t *c, int speed) {
    NEED(c);
    return speed == 3 && !of(c)->bmode_set ? INVALID_VALUE : SUCCESS;
}
int dc1394_format7_get_max_image_size(camera_t *c, int m, uint32_t *w, uint32_t *h) {
    NEED(c); (void)m; *w = SENSOR_W; *h = SENSOR_H; return SUCCESS;
}
int dc1394_format7_get_unit_size(camera_t *c, int m, uint32_t *w, uint32_t *h) {
    NEED(c); (void)m; *w = 8; *h = 4; return SUCCESS;
}
int dc1394_format7_get_unit_position(camera_t *c, int m, uint32_t *x, uint32_t *y) {
    NEED(c); (void)m; *x = 4; *y = 0; return SUCCESS;
}
int dc1394_format7_get_color_codings(camera_t *c, int m, uint32_t *codings) {
    NEED(c); (void)m;
    codings[0] = 3; codings[1] = MONO8; codings[2] = 356; codings[3] = MONO16;
    return SUCCESS;
}
int dc1394_format7_get_packet_parameters(camera_t *c, int m, uint32_t *unit, uint32_t *most) {
    NEED(c); (void)m; *unit = 4; *most = MOST; return SUCCESS;
}
int dc1394_format7_set_roi(camera_t *c, int m, int coding, int32_t packet, int32_t left,
                           int32_t top, int32_t width, int32_t height) {
    NEED(c); (void)m;
    state_t *s = of(c);
    if (s->buffers) return CAPTURE_RUNNING;
    if (packet < 4 || packet > MOST || packet % 4 || width % 8 || height % 4 || left % 4 || top % 4
        || left < 0 || top < 0 || left + width > SENSOR_W || top + height > SENSOR_H)
        return OUTSIDE_RANGE;
    s->coding = coding; s->packet = packet; s->left = left; s->top = top;
    s->width = width; s->height = height;
    return SUCCESS;
}
int dc1394_format7_get_roi(camera_t *c, int m, int *coding, uint32_t *packet, uint32_t *left,
                           uint32_t *top, uint32_t *width, uint32_t *height) {
    NEED(c); (void)m;
    state_t *s = of(c);
    *coding = s->coding; *packet = s->packet; *left = s->left; *top = s->top;
    *width = s->width; *height = s->height;
    return SUCCESS;
}

/* --- features ------------------------------------------------------------------------------ */
int dc1394_feature_is_present(camera_t *c, int f, int *is) {
    NEED(c);
    *is = f == SHUTTER || (of(c) == &state[0] && (f == GAIN || f == TRIGGER));
    return SUCCESS;
}
int dc1394_feature_set_mode(camera_t *c, int f, int mode) {
    NEED(c); (void)f; return mode == MANUAL ? SUCCESS : INVALID_VALUE;
}
int dc1394_feature_has_absolute_control(camera_t *c, int f, int *has) {
    NEED(c); (void)f; *has = of(c) == &state[0]; return SUCCESS;
}
int dc1394_feature_set_absolute_control(camera_t *c, int f, int on) {
    NEED(c); (void)f; (void)on; return of(c) == &state[0] ? SUCCESS : INVALID_FEATURE;
}
int dc1394_feature_get_absolute_boundaries(camera_t *c, int f, float *low, float *high) {
    NEED(c);
    *low = f == SHUTTER ? 1e-5f : 0.0f; *high = f == SHUTTER ? 2.0f : 24.0f;
    return SUCCESS;
}
int dc1394_feature_get_absolute_value(camera_t *c, int f, float *value) {
    NEED(c); *value = f == SHUTTER ? of(c)->shutter : of(c)->gain; return SUCCESS;
}
int dc1394_feature_set_absolute_value(camera_t *c, int f, float value) {
    NEED(c);
    if (f == SHUTTER) of(c)->shutter = value; else of(c)->gain = value;
    return SUCCESS;
}
int dc1394_feature_get_value(camera_t *c, int f, uint32_t *value) {
    NEED(c); (void)f; *value = of(c)->shutter_counts; return SUCCESS;
}
int dc1394_feature_set_value(camera_t *c, int f, uint32_t value) {
    NEED(c); (void)f;
    if (value < 1 || value > 4000) return OUTSIDE_RANGE;
    of(c)->shutter_counts = value;
    return SUCCESS;
}
int dc1394_feature_get_boundaries(camera_t *c, int f, uint32_t *low, uint32_t *high) {
    NEED(c); (void)f; *low = 1; *high = 4000; return SUCCESS;
}
int dc1394_external_trigger_set_power(camera_t *c, int on) { NEED(c); of(c)->triggered = on; return SUCCESS; }
int dc1394_external_trigger_set_mode(camera_t *c, int mode) {
    NEED(c); return mode == 384 ? SUCCESS : INVALID_VALUE;
}
int dc1394_external_trigger_set_source(camera_t *c, int source) {
    NEED(c); of(c)->source = source; return SUCCESS;
}
int dc1394_external_trigger_get_supported_sources(camera_t *c, uint32_t *sources) {
    NEED(c); sources[0] = 2; sources[1] = 576; sources[2] = SOFTWARE; return SUCCESS;
}

/* --- capture ------------------------------------------------------------------------------- */
int dc1394_software_trigger_set_power(camera_t *c, int on) {
    NEED(c);
    uint64_t one = 1;
    if (on && of(c)->is_event && of(c)->sending) (void)!write(of(c)->file, &one, sizeof one);
    return SUCCESS;
}
int dc1394_capture_setup(camera_t *c, uint32_t buffers, uint32_t flags) {
    NEED(c); (void)flags;
    state_t *s = of(c);
    if (s->buffers) return CAPTURE_RUNNING;
    if (buffers > RING) return INVALID_VALUE;
    s->buffers = buffers; s->waiting = s->sent = 0; s->is_event = s->triggered;
    s->file = s->triggered ? eventfd(0, EFD_NONBLOCK) : timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK);
    return SUCCESS;
}
int dc1394_capture_stop(camera_t *c) {
    state_t *s = of(c);
    if (!s->buffers) return CAPTURE_NOT_SET;
    close(s->file);
    for (int i = 0; i < RING; i++) { free(s->frames[i].image); s->frames[i].image = NULL; }
    s->buffers = 0; s->file = -1;
    return s->plugged ? SUCCESS : IOCTL_FAILURE;
}
int dc1394_capture_get_fileno(camera_t *c) { return of(c)->file; }
static double period_s(state_t *s) {
    if (s->mode != FORMAT7_0) return 1.0 / (1.875 * (double)(1 << (s->framerate - 32)));
    int bytes = s->width * s->height * (s->coding == MONO16 ? 2 : 1);
    return (bytes + s->packet - 1) / s->packet / 8000.0;
}
int dc1394_video_set_transmission(camera_t *c, int on) {
    NEED(c);
    state_t *s = of(c);
    s->sending = on;
    if (s->is_event || s->file < 0) return SUCCESS;
    double period = on ? period_s(s) : 0.0;
    struct timespec t = { (time_t)period, (long)((period - (time_t)period) * 1e9) };
    struct itimerspec timer = { t, t };
    return timerfd_settime(s->file, 0, &timer, NULL) ? IOCTL_FAILURE : SUCCESS;
}
int dc1394_video_get_transmission(camera_t *c, int *on) { NEED(c); *on = of(c)->sending; return SUCCESS; }
static void fill(state_t *s, frame_t *f) {
    int wide = s->coding == MONO16, gap = s->mode == FORMAT7_0 ? 0 : 16;
    size_t line = (size_t)s->width * (wide ? 2 : 1) + gap;
    free(f->image);
    f->image = malloc(line * s->height);
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < s->width; x++) {
            unsigned value = (unsigned)(x + y + s->sent);
            if (wide) {
                f->image[y * line + 2 * x] = (unsigned char)(value >> 8); /* high byte first */
                f->image[y * line + 2 * x + 1] = (unsigned char)value;
            } else f->image[y * line + x] = (unsigned char)value;
        }
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    double late = s->mode == FORMAT7_0 ? period_s(s) * s->waiting : 0.0;
    f->size[0] = s->width; f->size[1] = s->height; f->coding = s->coding; f->mode = s->mode;
    f->stride = (uint32_t)line; f->total_bytes = line * s->height; f->depth = wide ? 16 : 8;
    f->timestamp = (uint64_t)now.tv_sec * 1000000u + now.tv_nsec / 1000 - (uint64_t)(late * 1e6);
    f->behind = (uint32_t)s->waiting; f->id = s->sent % s->buffers; f->camera = &s->public;
    f->little_endian = 0;
}
int dc1394_capture_dequeue(camera_t *c, int policy, frame_t **frame) {
    state_t *s = of(c);
    *frame = NULL;
    if (!s->buffers) return CAPTURE_NOT_SET;
    if (policy != POLL) return INVALID_VALUE;
    if (!s->plugged) return IOCTL_FAILURE;
    uint64_t more = 0;
    if (read(s->file, &more, sizeof more) == sizeof more) s->waiting += more;
    if (s->skip && s->waiting) { /* lost on the bus, with the time that they took */
        int lost = s->skip < (int)s->waiting ? s->skip : (int)s->waiting;
        s->waiting -= lost; s->sent += lost; s->skip -= lost;
    }
    if (!s->waiting || !s->sending) return SUCCESS;
    if (s->waiting > (uint64_t)s->buffers) {
        s->sent += s->waiting - s->buffers;
        s->waiting = s->buffers;
    }
    s->waiting--;
    *frame = &s->frames[s->sent % s->buffers];
    fill(s, *frame);
    s->sent++;
    return SUCCESS;
}
int dc1394_capture_enqueue(camera_t *c, frame_t *frame) {
    (void)c; memset(frame->image, 0, 16); return SUCCESS; /* the kernel writes to it again */
}
int dc1394_capture_is_frame_corrupt(camera_t *c, frame_t *frame) {
    (void)frame;
    int corrupt = of(c)->corrupt;
    of(c)->corrupt = 0;
    return corrupt;
}
