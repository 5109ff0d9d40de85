// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/foot_switch.c: names of keys, refusals, and the bytes of an input device. A named pipe
 * takes its place, and this program answers the ioctls; tests/vm has the kernel's own.
 */
#include "../unit.h"
#include <fcntl.h>
#include <linux/input.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <incise/foot_switch.h>

#define LONG_BITS (8 * sizeof(long))

/* Answers of the device; an errno for its ioctls. */
static struct {
	int key, pressed, grabs;
	int no_input, grab;
} device;

static int answer(void *to, size_t size, int key)
{
	unsigned long *bits = to;

	memset(to, 0, size);
	if (key)
		bits[(size_t)key / LONG_BITS] |= 1UL << (size_t)key % LONG_BITS;
	return (int)size;
}

/* Takes the place of the C library's. */
int ioctl(int fd, unsigned long request, ...)
{
	va_list args;
	void *to;

	va_start(args, request);
	to = va_arg(args, void *);
	va_end(args);
	errno = EINVAL;
	if (request == EVIOCGRAB) {
		errno = device.grab;
		device.grabs += !device.grab;
		return device.grab ? -1 : 0;
	}
	if (_IOC_TYPE(request) != 'E' || _IOC_DIR(request) != _IOC_READ)
		return -1;
	errno = device.no_input;
	if (device.no_input)
		return -1;
	if (_IOC_NR(request) == _IOC_NR(EVIOCGKEY(0)))
		return answer(to, _IOC_SIZE(request), device.pressed);
	if (_IOC_NR(request) == _IOC_NR(EVIOCGBIT(EV_KEY, 0)))
		return answer(to, _IOC_SIZE(request), device.key);
	return -1;
}

struct pedal {
	char dir[40];
	struct incise_foot_switch_setup setup;
	struct incise_foot_switch *foot;
	int fd; /* the kernel's end */
};

static void plug_in(struct pedal *pedal)
{
	memset(&device, 0, sizeof(device));
	device.key = KEY_B;
	*pedal = (struct pedal){.dir = "/tmp/incise-foot-XXXXXX", .setup.key = KEY_B};
	assert_non_null(mkdtemp(pedal->dir));
	snprintf(pedal->setup.device, sizeof(pedal->setup.device), "%s/event",
		 pedal->dir);
	assert_int_equal(mkfifo(pedal->setup.device, 0600), 0);
	pedal->fd = open(pedal->setup.device, O_RDWR | O_NONBLOCK);
	assert_true(pedal->fd >= 0);
}

static void start(struct pedal *pedal)
{
	plug_in(pedal);
	pedal->foot = incise_foot_switch_open(&pedal->setup, &err);
	succeeds(pedal->foot);
	assert_int_equal(device.grabs, 1);
}

static void unplug(struct pedal *pedal)
{
	if (pedal->fd >= 0)
		close(pedal->fd);
	pedal->fd = -1;
}

static void end(struct pedal *pedal)
{
	unplug(pedal);
	incise_foot_switch_close(pedal->foot);
	unlink(pedal->setup.device);
	rmdir(pedal->dir);
}

static void happens(struct pedal *pedal, int type, int code, int value)
{
	const struct input_event event = {
		.type = (uint16_t)type, .code = (uint16_t)code, .value = value};

	assert_int_equal(write(pedal->fd, &event, sizeof(event)), sizeof(event));
}

static void press(struct pedal *pedal, int key)
{
	happens(pedal, EV_MSC, MSC_SCAN, 0x70005);
	happens(pedal, EV_KEY, key, 1);
	happens(pedal, EV_SYN, SYN_REPORT, 0);
}

static void release(struct pedal *pedal, int key)
{
	happens(pedal, EV_KEY, key, 0);
	happens(pedal, EV_SYN, SYN_REPORT, 0);
}

TEST(test_names)
{
	static const struct {
		const char *name;
		int code;
	} cases[] = {
		{"a", KEY_A},	  {"b", KEY_B},		  {"c", KEY_C},
		{"d", KEY_D},	  {"e", KEY_E},		  {"f", KEY_F},
		{"g", KEY_G},	  {"h", KEY_H},		  {"i", KEY_I},
		{"j", KEY_J},	  {"k", KEY_K},		  {"l", KEY_L},
		{"m", KEY_M},	  {"n", KEY_N},		  {"o", KEY_O},
		{"p", KEY_P},	  {"q", KEY_Q},		  {"r", KEY_R},
		{"s", KEY_S},	  {"t", KEY_T},		  {"u", KEY_U},
		{"v", KEY_V},	  {"w", KEY_W},		  {"x", KEY_X},
		{"y", KEY_Y},	  {"z", KEY_Z},		  {"0", KEY_0},
		{"1", KEY_1},	  {"9", KEY_9},		  {"f1", KEY_F1},
		{"f12", KEY_F12}, {"pageup", KEY_PAGEUP}, {"btn_left", BTN_LEFT},
		{"", -EINVAL},	  {"B", -EINVAL},	  {"bb", -EINVAL},
		{"f13", -EINVAL}, {"KEY_B", -EINVAL},	  {"\xc3\xa4", -EINVAL},
		{" ", -EINVAL},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		if (incise_foot_switch_key(cases[i].name) != cases[i].code)
			fail_msg("'%s' is %d", cases[i].name,
				 incise_foot_switch_key(cases[i].name));
}

TEST(test_refused)
{
	static const struct {
		int key, pressed, no_input, grab, code;
		const char *text;
	} cases[] = {
		{KEY_B, 0, EINVAL, 0, ENOTTY, NULL},
		{KEY_B, 0, ENOTTY, 0, ENOTTY, NULL},
		{KEY_B, 0, ENODEV, 0, ENODEV, NULL},
		{KEY_C, 0, 0, 0, ENXIO, "key"},
		{0, 0, 0, 0, ENXIO, "key"},
		{KEY_B, KEY_B, 0, 0, EBUSY, "release"},
		{KEY_B, 0, 0, EBUSY, EBUSY, "program"},
	};
	struct pedal pedal;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		plug_in(&pedal);
		device.key = cases[i].key;
		device.pressed = cases[i].pressed;
		device.no_input = cases[i].no_input;
		device.grab = cases[i].grab;
		assert_error(incise_foot_switch_open(&pedal.setup, &err), cases[i].code,
			     &err, cases[i].text, pedal.setup.device);
		assert_int_equal(device.grabs, 0);
		end(&pedal);
	}
	pedal.setup.key = KEY_MAX + 1;
	assert_null(incise_foot_switch_open(&pedal.setup, NULL));
	assert_int_equal(errno, ENOENT);
}

/* Presses of the key count, and nothing else. */
TEST(test_presses)
{
	struct pedal pedal;

	start(&pedal);
	assert_int_equal(incise_foot_switch_read(pedal.foot), 0);
	press(&pedal, KEY_B);
	assert_int_equal(incise_foot_switch_read(pedal.foot), 1);
	for (int i = 0; i < 30; i++)
		happens(&pedal, EV_KEY, KEY_B, 2);
	assert_int_equal(incise_foot_switch_read(pedal.foot), 0);
	release(&pedal, KEY_B);
	press(&pedal, KEY_A);
	release(&pedal, KEY_A);
	happens(&pedal, EV_REL, KEY_B, 1);
	happens(&pedal, EV_ABS, KEY_B, 1);
	assert_int_equal(incise_foot_switch_read(pedal.foot), 0);
	for (int i = 0; i < 3; i++) {
		press(&pedal, KEY_B);
		release(&pedal, KEY_B);
	}
	assert_int_equal(incise_foot_switch_read(pedal.foot), 3);
	/* More than one read takes. */
	for (int i = 0; i < 200; i++)
		happens(&pedal, EV_KEY, KEY_B, 1);
	assert_int_equal(incise_foot_switch_read(pedal.foot), 200);
	end(&pedal);
}

/* After an overrun of the kernel's buffer the rest of that report is not to be trusted. */
TEST(test_dropped)
{
	struct pedal pedal;

	start(&pedal);
	press(&pedal, KEY_B);
	happens(&pedal, EV_SYN, SYN_DROPPED, 0);
	happens(&pedal, EV_KEY, KEY_B, 1);
	assert_int_equal(incise_foot_switch_read(pedal.foot), 1);
	happens(&pedal, EV_KEY, KEY_B, 1);
	happens(&pedal, EV_SYN, SYN_REPORT, 0);
	assert_int_equal(incise_foot_switch_read(pedal.foot), 0);
	press(&pedal, KEY_B);
	assert_int_equal(incise_foot_switch_read(pedal.foot), 1);
	end(&pedal);
}

TEST(test_unplugged)
{
	struct pedal pedal;

	start(&pedal);
	press(&pedal, KEY_B);
	unplug(&pedal);
	/* First what came before. */
	assert_int_equal(incise_foot_switch_read(pedal.foot), 1);
	assert_int_equal(incise_foot_switch_read(pedal.foot), -ENODEV);
	assert_int_equal(incise_foot_switch_read(pedal.foot), -ENODEV);
	end(&pedal);
	start(&pedal);
	assert_int_equal(write(pedal.fd, "abc", 3), 3);
	assert_int_equal(incise_foot_switch_read(pedal.foot), -EIO);
	end(&pedal);
	incise_foot_switch_close(NULL);
}
