/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A stand-in for Force Dimension's dhdc.h with the names, types and units of its public documentation, as
 * far as examples/forcedimension uses them: 0.2 kg on a spring in software.
 */
#ifndef STUB_DHDC_H
#define STUB_DHDC_H

#include <string.h>

#define DHD_ON 1
#define DHD_OFF 0

typedef unsigned char uchar;
typedef unsigned int uint;

static double stub_m[3], stub_m_s[3];
static int stub_on;

static inline int dhdOpen(void)
{
	return 0;
}

static inline int dhdClose(char ID)
{
	return ID + 1;
}

static inline const char *dhdErrorGetLastStr(void)
{
	return "no error";
}

static inline const char *dhdGetSystemName(char ID)
{
	return ID == -1 ? "stub of dhd" : "";
}

static inline int dhdEnableForce(uchar val, char ID)
{
	stub_on = val;
	return ID + 1;
}

static inline int dhdSetGravityCompensation(int val, char ID)
{
	return val - DHD_ON + ID + 1;
}

static inline int dhdGetPosition(double *px, double *py, double *pz, char ID)
{
	*px = stub_m[0];
	*py = stub_m[1];
	*pz = stub_m[2];
	return ID + 1;
}

static inline int dhdGetLinearVelocity(double *vx, double *vy, double *vz, char ID)
{
	*vx = stub_m_s[0];
	*vy = stub_m_s[1];
	*vz = stub_m_s[2];
	return ID + 1;
}

/* A quarter turn about z: x points along y. */
static inline int dhdGetOrientationFrame(double matrix[3][3], char ID)
{
	static const double turned[3][3] = {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}};

	memcpy(matrix, turned, sizeof(turned));
	return ID + 1;
}

static inline uint dhdGetButtonMask(char ID)
{
	return ID == -1 ? 1 : 0;
}

static inline int dhdSetForce(double fx, double fy, double fz, char ID)
{
	const double force_N[3] = {fx, fy, fz};

	for (int i = 0; i < 3; i++) {
		stub_m_s[i] +=
			0.001 / 0.2 *
			((stub_on ? force_N[i] : 0) - 200 * stub_m[i] - 4 * stub_m_s[i]);
		stub_m[i] += 0.001 * stub_m_s[i];
	}
	return ID + 1;
}

#endif
