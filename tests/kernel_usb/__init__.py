"""``make test-kernel-usb``: the USB and serial doors through a real Linux USB stack, without a rig.

    host    run.py       packages.py fetches Debian's qemu and kernel, image.py makes an initramfs
            └─ qemu      software emulation: no KVM, no privileges
    guest   guest.py     loads the kernel's USB modules, runs the cases, one line of JSON for each
            ├─ usbip.py  the emulated rig behind vhci-hcd: what pyusb and libusb meet is the kernel
            └─ gadget.py the emulated rig behind dummy_hcd as a CDC-ACM port: a true /dev/ttyACM0

Opt-in, because it fetches packages and takes a while; nothing in `make test` needs it.
"""
