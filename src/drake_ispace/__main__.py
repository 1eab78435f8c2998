from drake_ispace.cli.app import main

main()
