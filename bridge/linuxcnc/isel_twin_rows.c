/* LinuxCNC's set points to a twin, and its switches back, in lockstep: a realtime component.

   Each servo period one row goes to `isel-twin serve --controller external --speed max --tcp 127.0.0.1:PORT`, and the
   function waits for its answer. So virtual time is cycles times period, however late a thread without a realtime kernel
   is. Without an answer power-ok falls and stays low, and `silent` counts.

     loadrt isel_twin_rows port=7800 scale=320,320,320     addf isel-twin.rows servo-thread, behind motion-controller

   pins     isel-twin.pos-N (float in, mm), .enable, .request (bit in), .limit-1-N, .limit-2-N, .fault-N, .power-ok,
            .estop-ok (bit out), .silent, .refused (u32 out)
*/
#include <rtapi.h>
#include <rtapi_app.h>
#include <hal.h>

#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#define JOINTS 3
#define LINE 1024
#define PATIENCE_S 10 /* wall time for an answer: the twin may have to load something once */

MODULE_AUTHOR("isel-twin");
MODULE_DESCRIPTION("Set points to a simulated isel gantry, in lockstep");
MODULE_LICENSE("Apache-2.0");
static int port = 7800;
RTAPI_MP_INT(port, "TCP port of the twin on this computer");
static int scale[JOINTS] = {320, 320, 320};
RTAPI_MP_ARRAY_INT(scale, JOINTS, "counts per machine unit");

static struct {
  hal_float_t *pos[JOINTS];
  hal_bit_t *enable, *request, *limit1[JOINTS], *limit2[JOINTS], *fault[JOINTS], *power_ok, *estop_ok;
  hal_u32_t *silent, *refused;
} *pin;

static int component, line = -1;
static const char *const NAMES[] = {"limit_x1", "limit_y1", "limit_z1", "limit_x2", "limit_y2",
                                    "limit_z2", "power_ok", "estop_1",  "estop_2"};
static int bit[9]; /* of each name in LEVELS; -1: this machine has none */
static char text[2 * LINE];

/* Send a line and wait for the answer; 0, or -1 without one. */
static int ask(char *answer) {
  size_t length = strlen(text), have = 0;
  if (line < 0 || send(line, text, length, MSG_NOSIGNAL) != (ssize_t)length) return -1;
  while (have < LINE - 1) {
    ssize_t got = recv(line, answer + have, LINE - 1 - have, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return -1;
    have += got;
    answer[have] = 0;
    if (answer[have - 1] == '\n') return 0;
  }
  return -1;
}

static int level(unsigned long long levels, int which) { return bit[which] < 0 || (levels >> bit[which] & 1); }

static void rows(void *unused, long period) {
  static char answer[LINE];
  unsigned long long levels = 0, faults = 0;
  long long now;
  int n;
  snprintf(text, sizeof text, "row %ld %lld %lld %lld stages=%d brake=%d power_request=%d\n", period,
           llrint(*pin->pos[0] * scale[0]), llrint(*pin->pos[1] * scale[1]), llrint(*pin->pos[2] * scale[2]),
           *pin->enable != 0, *pin->enable != 0, *pin->request != 0);
  if (line >= 0 && ask(answer) < 0) {
    close(line);
    line = -1;
    rtapi_print_msg(RTAPI_MSG_ERR, "isel_twin_rows: the twin does not answer\n");
  }
  if (line < 0) {
    ++*pin->silent;
    *pin->power_ok = *pin->estop_ok = 0;
    return;
  }
  if (sscanf(answer, "ok %lld %llx %llx", &now, &levels, &faults) != 3) {
    if (++*pin->refused == 1) rtapi_print_msg(RTAPI_MSG_ERR, "isel_twin_rows: %s", answer);
    *pin->power_ok = 0;
    return;
  }
  for (n = 0; n < JOINTS; n++) {
    *pin->limit1[n] = !level(levels, n); /* a struck switch is low */
    *pin->limit2[n] = !level(levels, JOINTS + n);
    *pin->fault[n] = faults >> n & 1;
  }
  *pin->power_ok = level(levels, 6);
  *pin->estop_ok = level(levels, 7) && level(levels, 8);
}

/* Say why, as the twin has it: another client has its port, it has other axes, its watchdog has struck. */
static int refused(const char *answer) {
  rtapi_print_msg(RTAPI_MSG_ERR, "isel_twin_rows: the twin says: %s", answer);
  errno = ECONNREFUSED;
  return -1;
}

/* Connect, and learn which bit is which; 0, or -1. */
static int begin(void) {
  static char answer[LINE];
  struct timeval patience = {PATIENCE_S, 0};
  struct sockaddr_in where = {.sin_family = AF_INET, .sin_port = htons(port)};
  int at_once = 1, at, n;
  char *word, *rest = answer;
  where.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  line = socket(AF_INET, SOCK_STREAM, 0);
  if (line < 0 || connect(line, (struct sockaddr *)&where, sizeof where) < 0) return -1;
  setsockopt(line, IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof at_once);
  setsockopt(line, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  snprintf(text, sizeof text, "names\n");
  if (ask(answer) < 0) return -1;
  if (strncmp(answer, "names axes=3 ", 13)) return refused(answer);
  for (n = 0; n < 9; n++) bit[n] = -1;
  for (at = -2; (word = strtok_r(rest, " \n", &rest)); at++)
    for (n = 0; n < 9; n++)
      if (!strcmp(word, NAMES[n])) bit[n] = at;
  snprintf(text, sizeof text, "set 0 0 0\n"); /* LinuxCNC begins at 0, wherever the machine stands */
  if (ask(answer) < 0) return -1;
  return strncmp(answer, "ok ", 3) ? refused(answer) : 0;
}

static int make_pins(void) {
  int n, bad = 0;
  pin = hal_malloc(sizeof *pin);
  if (!pin) return -1;
  for (n = 0; n < JOINTS; n++) {
    bad |= hal_pin_float_newf(HAL_IN, &pin->pos[n], component, "isel-twin.pos-%d", n);
    bad |= hal_pin_bit_newf(HAL_OUT, &pin->limit1[n], component, "isel-twin.limit-1-%d", n);
    bad |= hal_pin_bit_newf(HAL_OUT, &pin->limit2[n], component, "isel-twin.limit-2-%d", n);
    bad |= hal_pin_bit_newf(HAL_OUT, &pin->fault[n], component, "isel-twin.fault-%d", n);
  }
  bad |= hal_pin_bit_newf(HAL_IN, &pin->enable, component, "isel-twin.enable");
  bad |= hal_pin_bit_newf(HAL_IN, &pin->request, component, "isel-twin.request");
  bad |= hal_pin_bit_newf(HAL_OUT, &pin->power_ok, component, "isel-twin.power-ok");
  bad |= hal_pin_bit_newf(HAL_OUT, &pin->estop_ok, component, "isel-twin.estop-ok");
  bad |= hal_pin_u32_newf(HAL_OUT, &pin->silent, component, "isel-twin.silent");
  bad |= hal_pin_u32_newf(HAL_OUT, &pin->refused, component, "isel-twin.refused");
  return bad ? -1 : hal_export_funct("isel-twin.rows", rows, 0, 1, 0, component);
}

int rtapi_app_main(void) {
  component = hal_init("isel_twin_rows");
  if (component < 0) return component;
  if (make_pins() < 0 || begin() < 0) {
    rtapi_print_msg(RTAPI_MSG_ERR, "isel_twin_rows: no twin at 127.0.0.1:%d: %s\n", port, strerror(errno));
    if (line >= 0) close(line);
    hal_exit(component);
    return -1;
  }
  return hal_ready(component);
}

void rtapi_app_exit(void) {
  if (line >= 0) close(line);
  hal_exit(component);
}
