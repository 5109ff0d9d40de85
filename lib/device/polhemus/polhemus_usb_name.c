// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What rig.conf calls a tracker on USB; see polhemus_usb_name.h.
 */
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include "../../base/hex.h"
#include "polhemus_usb_name.h"

/* Four hexadecimal digits. */
static int read_id(const char *text, uint16_t *id)
{
	unsigned int value = 0;

	for (int i = 0; i < 4; i++) {
		int digit = incise_hex_digit(text[i]);

		if (digit < 0)
			return -EINVAL;
		value = value * 16 + (unsigned int)digit;
	}
	*id = (uint16_t)value;
	return 0;
}

/* A number of at most three digits, as polhemus_usb_path() writes it; what follows, or NULL. */
static const char *skip_number(const char *text)
{
	int value = 0, n = 0;

	for (; n < 3 && text[n] >= '0' && text[n] <= '9'; n++)
		value = value * 10 + (text[n] - '0');
	return n && text[0] != '0' && value <= 255 ? text + n : NULL;
}

/* "1-1.2" */
static bool is_path(const char *text)
{
	text = skip_number(text);
	if (!text || *text++ != '-')
		return false;
	for (text = skip_number(text); text && *text == '.';)
		text = skip_number(text + 1);
	return text && !*text;
}

int polhemus_usb_name_read(const char *text, struct polhemus_usb_name *name)
{
	size_t n;

	memset(name, 0, sizeof(*name));
	if (read_id(text, &name->vendor) || text[4] != ':' ||
	    read_id(text + 5, &name->product))
		return -EINVAL;
	text += 9;
	if (!*text)
		return 0;
	n = strlen(text + 1);
	if (*text == '#' && n && n < sizeof(name->serial))
		memcpy(name->serial, text + 1, n + 1);
	else if (*text == '@' && n < sizeof(name->path) && is_path(text + 1))
		memcpy(name->path, text + 1, n + 1);
	else
		return -EINVAL;
	return 0;
}

void polhemus_usb_path(char path[POLHEMUS_USB_PATH_MAX], unsigned int bus,
		       const uint8_t *ports, int n)
{
	int at = snprintf(path, POLHEMUS_USB_PATH_MAX, "%u-%u", bus & 0xff,
			  n > 0 ? ports[0] : 0);

	for (int i = 1; i < n && at <= POLHEMUS_USB_PATH_MAX - 5; i++)
		at += snprintf(path + at, POLHEMUS_USB_PATH_MAX - (size_t)at, ".%u",
			       ports[i]);
}
