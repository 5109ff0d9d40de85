/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A stand-in for OpenHaptics' HD/hd.h with the names, types and units of its public documentation, as far
 * as examples/openhaptics uses them. Its scheduler runs where its end is waited for.
 */
#ifndef STUB_HD_H
#define STUB_HD_H

#include <limits.h>
#include <string.h>
#include <unistd.h>

#define HDCALLBACK
#define HD_DEFAULT_DEVICE NULL
#define HD_SUCCESS 0
#define HD_DEVICE_ERROR(X) (((X).errorCode) != HD_SUCCESS)
#define HD_MAX_SCHEDULER_PRIORITY USHRT_MAX
#define HD_CALLBACK_DONE 0
#define HD_CALLBACK_CONTINUE 1
#define HD_WAIT_INFINITE 1

enum {
	HD_CURRENT_BUTTONS,
	HD_CURRENT_POSITION,
	HD_CURRENT_VELOCITY,
	HD_CURRENT_TRANSFORM,
	HD_CURRENT_FORCE,
	HD_USABLE_WORKSPACE_DIMENSIONS,
	HD_NOMINAL_MAX_FORCE,
	HD_NOMINAL_MAX_CONTINUOUS_FORCE,
	HD_DEVICE_MODEL_TYPE,
	HD_DEVICE_SERIAL_NUMBER,
	HD_FORCE_OUTPUT,
};

typedef unsigned int HHD, HDenum, HDerror, HDCallbackCode, HDWaitCode;
typedef int HDint;
typedef double HDdouble;
typedef unsigned short HDushort;
typedef unsigned long HDulong, HDSchedulerHandle;
typedef unsigned char HDboolean;
typedef const char *HDstring;
typedef HDCallbackCode(HDCALLBACK *HDSchedulerCallback)(void *pUserData);

typedef struct {
	HDerror errorCode;
	int internalErrorCode;
	HHD hHD;
} HDErrorInfo;

static HDSchedulerCallback stub_callback;
static void *stub_data;
static double stub_mm[3] = {1, 2, 3};
static HDerror stub_error = HD_SUCCESS; /* of all calls from now on */

static inline HHD hdInitDevice(HDstring name)
{
	return name == HD_DEFAULT_DEVICE;
}

static inline HDErrorInfo hdGetError(void)
{
	HDErrorInfo error = {stub_error, 0, 0};

	return error;
}

static inline HDstring hdGetErrorString(HDerror code)
{
	return code ? "an error" : "none";
}

static inline HDstring hdGetString(HDenum name)
{
	return name == HD_DEVICE_MODEL_TYPE ? "stub of HD" : "0";
}

static inline void hdBeginFrame(HHD device)
{
	(void)device;
}

static inline void hdEndFrame(HHD device)
{
	(void)device;
}

static inline void hdDisableDevice(HHD device)
{
	(void)device;
}

static inline void hdEnable(HDenum capability)
{
	(void)capability;
}

static inline void hdGetIntegerv(HDenum name, HDint *values)
{
	*values = name == HD_CURRENT_BUTTONS ? 2 : 0;
}

static inline void hdGetDoublev(HDenum name, HDdouble *values)
{
	static const double box[6] = {-80, -60, -35, 80, 60, 35};
	/* column by column: a quarter turn about z */
	static const double transform[16] = {0, 1, 0, 0, -1, 0, 0, 0,
					     0, 0, 1, 0, 1,  2, 3, 1};

	if (name == HD_CURRENT_POSITION)
		memcpy(values, stub_mm, sizeof(stub_mm));
	else if (name == HD_CURRENT_VELOCITY)
		memset(values, 0, 3 * sizeof(*values));
	else if (name == HD_CURRENT_TRANSFORM)
		memcpy(values, transform, sizeof(transform));
	else if (name == HD_USABLE_WORKSPACE_DIMENSIONS)
		memcpy(values, box, sizeof(box));
	else
		*values = name == HD_NOMINAL_MAX_FORCE ? 3.3 : 0.88;
}

/* 1 N moves it by 1 mm. */
static inline void hdSetDoublev(HDenum name, const HDdouble *values)
{
	for (int i = 0; i < 3 && name == HD_CURRENT_FORCE; i++)
		stub_mm[i] = 1 + i + values[i];
}

static inline void hdSetSchedulerRate(HDulong rate)
{
	(void)rate;
}

static inline HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback callback,
						       void *data, HDushort priority)
{
	stub_callback = callback;
	stub_data = data;
	return priority;
}

static inline void hdStartScheduler(void)
{
}

static inline HDboolean hdWaitForCompletion(HDSchedulerHandle handle, HDWaitCode param)
{
	while (stub_callback(stub_data) == HD_CALLBACK_CONTINUE)
		usleep(1000);
	return handle && param;
}

static inline void hdStopScheduler(void)
{
}

static inline void hdUnschedule(HDSchedulerHandle handle)
{
	(void)handle;
}

#endif
