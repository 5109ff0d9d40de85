// not compiled against the real headers, not run against the real thing
// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * device NAME: a Touch, Touch X or Phantom of 3D Systems for `--rig local:NAME`.
 *
 *     cc -D_GNU_SOURCE device.c -lHD -lm -o device        with OpenHaptics 3.4 for Linux
 *     ./device touch
 *
 * The names are those of OpenHaptics' public documentation (mm, mm/s, newtons; x right, y up, z to the user).
 * The scheduler of OpenHaptics is the clock: its thread is the only one that writes the page.
 */
#include <signal.h>
#include <HD/hd.h>
#include "../haptic_page/owner.h"

static volatile sig_atomic_t stop;

struct touch {
	struct owner owner;
	HHD device;
	double peak_N;
	const char *failed; /* NULL: not */
};

static void ask_end(int number)
{
	stop = number;
}

static void read_device(struct incise_haptic_page_sample *sample)
{
	HDdouble transform[16]; /* column by column */
	double frame[3][3];
	HDint buttons = 0;
	int i, k;

	hdGetDoublev(HD_CURRENT_POSITION, sample->position_mm);
	hdGetDoublev(HD_CURRENT_VELOCITY, sample->velocity_mm_s);
	hdGetDoublev(HD_CURRENT_TRANSFORM, transform);
	hdGetIntegerv(HD_CURRENT_BUTTONS, &buttons);
	for (i = 0; i < 3; i++)
		for (k = 0; k < 3; k++)
			frame[i][k] = transform[4 * k + i];
	quaternion_of((const double(*)[3])frame, sample->quaternion);
	sample->buttons = (uint32_t)buttons;
}

static void keep_error(struct touch *touch)
{
	HDErrorInfo error = hdGetError();

	if (HD_DEVICE_ERROR(error) && !touch->failed)
		touch->failed = hdGetErrorString(error.errorCode);
}

/* A tick of the scheduler. The last one, after a failure or a signal, sets no force. */
static HDCallbackCode HDCALLBACK serve(void *data)
{
	struct touch *touch = (struct touch *)data;
	struct incise_haptic_page_sample sample;
	HDdouble force_N[3] = {0, 0, 0};
	int last = stop || touch->failed;

	memset(&sample, 0, sizeof(sample));
	hdBeginFrame(touch->device);
	read_device(&sample);
	keep_error(touch);
	if (!touch->failed)
		owner_sample(&touch->owner, &sample);
	if (!touch->failed && !last)
		owner_force(&touch->owner, touch->peak_N, force_N);
	hdSetDoublev(HD_CURRENT_FORCE, force_N);
	hdEndFrame(touch->device);
	keep_error(touch);
	return last ? HD_CALLBACK_DONE : HD_CALLBACK_CONTINUE;
}

/* Constant properties, before the scheduler runs. */
static void describe_device(struct touch *touch)
{
	struct incise_haptic_info *device = &touch->owner.page->device;
	HDdouble box[6] = {0, 0, 0, 0, 0, 0}, peak_N = 0, continuous_N = 0;
	int i;

	hdGetDoublev(HD_USABLE_WORKSPACE_DIMENSIONS, box);
	hdGetDoublev(HD_NOMINAL_MAX_FORCE, &peak_N);
	hdGetDoublev(HD_NOMINAL_MAX_CONTINUOUS_FORCE, &continuous_N);
	for (i = 0; i < 3; i++) {
		device->low_mm[i] = box[i];
		device->high_mm[i] = box[3 + i];
	}
	snprintf(device->name, sizeof(device->name), "%s %s",
		 hdGetString(HD_DEVICE_MODEL_TYPE), hdGetString(HD_DEVICE_SERIAL_NUMBER));
	device->rate_hz = 1000;
	device->peak_N = touch->peak_N = peak_N;
	device->continuous_N = continuous_N;
	device->buttons = 2;
	device->features = INCISE_HAPTIC_PAGE_VELOCITY | INCISE_HAPTIC_PAGE_ORIENTATION;
}

int main(int argc, char **argv)
{
	static struct touch touch;
	HDSchedulerHandle served;
	HDErrorInfo error;

	if (argc != 2) {
		fprintf(stderr, "usage: %s NAME\n", argv[0]);
		return 2;
	}
	touch.device = hdInitDevice(HD_DEFAULT_DEVICE);
	error = hdGetError();
	if (HD_DEVICE_ERROR(error)) {
		fprintf(stderr, "no device: %s\n", hdGetErrorString(error.errorCode));
		return 1;
	}
	if (owner_begin(&touch.owner, argv[1])) {
		hdDisableDevice(touch.device);
		return 1;
	}
	signal(SIGTERM, ask_end);
	signal(SIGINT, ask_end);
	describe_device(&touch);
	hdEnable(HD_FORCE_OUTPUT);
	hdSetSchedulerRate(1000);
	served = hdScheduleAsynchronous(serve, &touch, HD_MAX_SCHEDULER_PRIORITY);
	hdStartScheduler();
	hdWaitForCompletion(served, HD_WAIT_INFINITE);
	hdStopScheduler();
	hdUnschedule(served);
	hdDisableDevice(touch.device);
	owner_end(&touch.owner,
		  touch.failed ? INCISE_HAPTIC_PAGE_FAILED : INCISE_HAPTIC_PAGE_ENDED,
		  touch.failed ? touch.failed : "stopped; start it again");
	return touch.failed != NULL;
}
