// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Looking for devices behind a backend; see incise/scan.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <incise/scan.h>
#include "backends.h"

/* Adds the kind to each device that a backend finds. */
struct kind_found {
	const char *kind;
	incise_scan_found *found;
	void *context;
	int rc; /* last return of found */
};

static int pass_on(void *context, const struct incise_scan_device *device)
{
	struct incise_scan_device copy = *device;
	struct kind_found *of = context;

	snprintf(copy.kind, sizeof(copy.kind), "%s", of->kind);
	return of->rc = of->found(of->context, &copy);
}

static int scan_backend(struct kind_found *of, const char *name)
{
	struct incise_scan_device failed = {0};
	struct incise_error err = {0};
	char spec[40];
	int rc;

	snprintf(spec, sizeof(spec), "%.31s:", name);
	rc = incise_scan(of->kind, spec, of->found, of->context, &err);
	/* It cannot search, or not without arguments. */
	if (!err.code || rc == -EOPNOTSUPP || rc == -EINVAL)
		return err.code ? 0 : rc;
	snprintf(failed.kind, sizeof(failed.kind), "%s", of->kind);
	snprintf(failed.device, sizeof(failed.device), "%s", spec);
	snprintf(failed.what, sizeof(failed.what), "%.239s", err.text);
	return of->found(of->context, &failed);
}

static const char *const kinds[] = {"tracker", "force", "camera", "haptic", "stepper"};
#define KINDS (sizeof(kinds) / sizeof(*kinds))
#define NAMES 16

/* The backend of that name, of any kind. */
static int find_any(struct incise_loaded *loaded, struct kind_found *of, const char *name,
		    const char *where, struct incise_error *err)
{
	char names[NAMES][32], known[KINDS * NAMES * 34] = "sim";
	int rc = -ENODEV;

	for (size_t k = 0; k < KINDS && rc == -ENODEV; k++) {
		int n = incise_backend_names(kinds[k], names, NAMES);

		of->kind = kinds[k];
		rc = incise_backend_find(loaded, kinds[k], name, where, err);
		for (int i = 0; i < n; i++) {
			size_t used = strlen(known);

			snprintf(known + used, sizeof(known) - used, ", %s", names[i]);
		}
	}
	return rc == -ENODEV ? incise_error_set(err, ENODEV,
						"%s: no such backend \"%.40s\"; there "
						"are: %.160s",
						where, name, known)
			     : rc;
}

/* Each backend of each kind that needs no arguments. */
static int scan_all(incise_scan_found *found, void *context)
{
	char names[NAMES][32];
	int rc = 0;

	for (size_t k = 0; k < KINDS && !rc; k++) {
		struct kind_found of = {kinds[k], found, context, 0};
		int n = incise_backend_names(kinds[k], names, NAMES);

		for (int i = 0; i < n && !rc; i++)
			rc = scan_backend(&of, names[i]);
	}
	return rc;
}

int incise_scan(const char *kind, const char *spec, incise_scan_found *found,
		void *context, struct incise_error *err)
{
	struct incise_loaded loaded = {0};
	struct kind_found of = {kind, found, context, 0};
	char name[32], where[80];
	size_t length;
	int rc = 0;

	if (!spec)
		return scan_all(found, context);
	length = strcspn(spec, ":");
	if (!spec[length] || length >= sizeof(name))
		return incise_error_set(err, EINVAL,
					"%.60s: expected BACKEND:ARGUMENTS such as "
					"can:can0; correct it",
					spec);
	snprintf(name, sizeof(name), "%.*s", (int)length, spec);
	snprintf(where, sizeof(where), "%.70s", spec);
	/* The virtual rig is there for every kind. */
	if (strcmp(name, "sim"))
		rc = kind ? incise_backend_find(&loaded, kind, name, where, err)
			  : find_any(&loaded, &of, name, where, err);
	if (rc)
		return rc;
	if (loaded.backend && loaded.backend->scan)
		rc = loaded.backend->scan(spec + length + 1, pass_on, &of, err);
	else
		rc = incise_error_set(err, EOPNOTSUPP,
				      "%s: this backend cannot search for devices; "
				      "name yours in rig.conf",
				      where);
	incise_backend_unload(&loaded);
	return rc;
}

void incise_scan_tell(struct incise_scan_device *device, const char *key,
		      const char *format, ...)
{
	struct incise_scan_property *property;
	va_list args;

	if (device->n >= INCISE_SCAN_PROPERTIES)
		return;
	property = &device->property[device->n++];
	property->key = key;
	va_start(args, format);
	vsnprintf(property->text, sizeof(property->text), format, args);
	va_end(args);
}
