// SPDX-License-Identifier: GPL-2.0-only
/*
 * The ADC's own trigger: a hard timer, so that it also is there on kernels
 * without iio-trig-hrtimer (6.1). Every period is a conversion, even when the
 * thread has not yet handed over the one before: IIO would leave that trigger
 * out, hardware with a store would not.
 *
 *	timer    |     |     |     |     |
 *	convert  x     x     x     x     x
 *	thread    >      >>>>>>>>>   >>    >
 */
#include <linux/device.h>
#include <linux/iio/trigger.h>
#include <linux/module.h>
#include <linux/sysfs.h>

#include "../compat.h"
#include "adc.h"

static ktime_t sim_trigger_period(const struct sim_adc *adc)
{
	return ns_to_ktime(NSEC_PER_SEC / READ_ONCE(adc->frequency));
}

static enum hrtimer_restart sim_trigger_fire(struct hrtimer *timer)
{
	struct sim_adc *adc = container_of(timer, struct sim_adc, timer);
	unsigned long flags;
	u64 periods;

	periods = hrtimer_forward_now(timer, sim_trigger_period(adc));
	if (periods > 1) {
		raw_spin_lock_irqsave(&adc->lock, flags);
		adc->skipped += periods - 1;
		raw_spin_unlock_irqrestore(&adc->lock, flags);
	}
	if (atomic_read(&adc->trigger->use_count))
		sim_adc_convert_to_fifo(adc);
	else
		iio_trigger_poll(adc->trigger);
	return HRTIMER_RESTART;
}

static int sim_trigger_switch(struct iio_trigger *trigger, bool on)
{
	struct sim_adc *adc = iio_trigger_get_drvdata(trigger);

	if (on)
		hrtimer_start(&adc->timer,
			      ktime_add(ktime_get(), sim_trigger_period(adc)),
			      HRTIMER_MODE_ABS_HARD);
	else
		hrtimer_cancel(&adc->timer);
	return 0;
}

static const struct iio_trigger_ops sim_trigger_ops = {
	.set_trigger_state = sim_trigger_switch,
	.validate_device = iio_trigger_validate_own_device,
};

static ssize_t sampling_frequency_show(struct device *dev, struct device_attribute *attr,
				       char *to)
{
	struct sim_adc *adc = iio_trigger_get_drvdata(to_iio_trigger(dev));

	return sysfs_emit(to, "%u\n", READ_ONCE(adc->frequency));
}

static ssize_t sampling_frequency_store(struct device *dev, struct device_attribute *attr,
					const char *from, size_t size)
{
	struct sim_adc *adc = iio_trigger_get_drvdata(to_iio_trigger(dev));
	int hertz, ret;

	ret = kstrtoint(from, 10, &hertz);
	if (!ret)
		ret = sim_adc_set_frequency(adc, hertz);
	return ret ? ret : size;
}
static DEVICE_ATTR_RW(sampling_frequency);

static struct attribute *sim_trigger_attrs[] = {
	&dev_attr_sampling_frequency.attr,
	NULL,
};
ATTRIBUTE_GROUPS(sim_trigger);

int sim_trigger_add(struct sim_adc *adc, struct device *parent)
{
	struct iio_trigger *trigger;
	int ret;

	/*
	 * No owner: as the default trigger of a device in the same module it
	 * would hold the module for ever. Nobody else may use it.
	 */
	trigger = __iio_trigger_alloc(parent, NULL, "%s", INCISE_SIM_TRIGGER);
	if (!trigger)
		return -ENOMEM;
	trigger->ops = &sim_trigger_ops;
	trigger->dev.groups = sim_trigger_groups;
	iio_trigger_set_drvdata(trigger, adc);
	hrtimer_setup(&adc->timer, sim_trigger_fire, CLOCK_MONOTONIC,
		      HRTIMER_MODE_ABS_HARD);
	ret = iio_trigger_register(trigger);
	if (ret) {
		iio_trigger_free(trigger);
		return ret;
	}
	adc->trigger = trigger;
	return 0;
}

void sim_trigger_remove(struct sim_adc *adc)
{
	iio_trigger_unregister(adc->trigger);
	hrtimer_cancel(&adc->timer);
	iio_trigger_free(adc->trigger);
}
